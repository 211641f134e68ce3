# make run               opens the editor on a sample photo; PHOTO=my.jpg opens that one
# make test              sets everything up and runs the tests; ARGS="-k session" runs some
# make test-slow         the tests that take longer: CI's second stage
#
# Both work in a fresh clone: they make .venv and install into it. A second call is fast.

SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.ONESHELL:
.PHONY: run test help
.DEFAULT_GOAL := help

PYTHON := .venv/bin/python
PIP := $(PYTHON) -m pip --disable-pip-version-check
# Bytecode, also where PYTHONDONTWRITEBYTECODE says that no import writes any: every window has a
# worker process, which would compile all sources anew.
COMPILE := $(PYTHON) -m compileall -q -j 0 app objectmorpher_core research tests
# The kernels, before processes that begin together compile the same ones.
KERNELS := PYTHONDONTWRITEBYTECODE= $(PYTHON) -m tests.kernels
# The tests' assertions, for the same reason.
REWRITTEN := PYTHONDONTWRITEBYTECODE= $(PYTHON) -m tests.rewritten
# Of what tests need, Python compiles what they import when they do: a third of it.
INSTALL := $(PIP) install --no-compile
PHOTO ?=
ARGS ?=
LOCK ?= # versions and hashes of what the tests need: packaging/locks/ci.txt
# Several test files run at a time, each in one process: one more than there are cores, for tests with a
# window wait as long as they work; JOBS=0 is for debuggers. Python keeps what it compiles of the tests,
# which is a third of the time that a run takes to begin.
JOBS ?= $(shell echo $$(($$(nproc 2>/dev/null || echo 4) + 1)))
PYTEST = PYTHONDONTWRITEBYTECODE= $(PYTHON) -m pytest -n $(JOBS) --maxprocesses 4 --dist loadfile --no-loadscope-reorder

# Installs Debian packages where this is Debian or Ubuntu and we may; fails quietly elsewhere.
define APT
apt_install() {
    [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null || return 1
    echo "Installing $$*"
    export DEBIAN_FRONTEND=noninteractive
    apt-get install -y -q --no-install-recommends "$$@" >/dev/null 2>&1 ||
        { apt-get update -q >/dev/null && apt-get install -y -q --no-install-recommends "$$@" >/dev/null; }
}
endef

help:
	@sed -n 's/^# //p' Makefile | head -3

run: .make/run
	@$(COMPILE)
	$(PYTHON) -m objectmorpher models get || echo "The learned models could not be fetched; the built-in methods are used instead."
	if [ -n "$(PHOTO)" ]; then exec $(PYTHON) -m objectmorpher "$(PHOTO)"; else exec $(PYTHON) -m objectmorpher --sample; fi

test: .make/test
	@$(COMPILE)
	@$(KERNELS)
	$(PYTEST) -m "not slow" $(ARGS)

.PHONY: test-slow
test-slow: .make/test
	@$(COMPILE)
	@$(KERNELS)
	$(PYTEST) -m slow $(ARGS)

# The tests of what needs PyTorch or Ray, which `make test` leaves out: networks of their real code,
# tiny and with random weights. TORCH names the build that pip is to install.
.PHONY: test-models
TORCH ?= torch==2.13.0
BESIDE := 'torchmetrics>=1.6' # others' measures, to compare ours with
LEARNED := [^-]torch|transformers|diffusers|huggingface_hub|peft|onnx|"ray"|ray_apart
test-models: .make/models
	@$(COMPILE)
	@$(KERNELS)
	$(PYTEST) -m "slow or not slow" $(ARGS) $$(grep -rlE '$(LEARNED)' tests --include='test_*.py' | sort)

# What `make test` leaves out: the slow tests, and what PyTorch, Ray or a browser is needed for.
.PHONY: test-rest
test-rest: .make/test
	@$(COMPILE)
	@$(KERNELS)
	$(PYTEST) -m "slow or not slow" $(ARGS) $$(grep -rlE 'mark\.slow|quick\(|browser|$(LEARNED)' tests --include='test_*.py' | sort)

.make/models: .make/test
	@$(INSTALL) -q '$(TORCH)' $(BESIDE) -e '.[dev,models,research,cluster]' -e research
	touch $@

# The study's page in a real browser, which `make test` leaves out: Chromium is large.
.PHONY: test-browser
test-browser: .make/browser
	@$(PYTHON) -m pytest -m "slow or not slow" $(ARGS) tests/research/study/test_study_browser.py

.make/browser: .make/test
	@$(INSTALL) -q -e '.[dev,browser]' -e research
	$(APT)
	command -v chromedriver >/dev/null || apt_install chromium chromium-driver
	touch $@

.make/run: .make/venv pyproject.toml
	@echo "Installing ObjectMorpher into .venv (minutes, the first time)"
	$(PIP) install --progress-bar on -e .
	$(APT)
	if [ "$$(uname)" = Linux ] && [ -n "$${DISPLAY:-}$${WAYLAND_DISPLAY:-}" ] &&
	    ! $(PYTHON) -c 'import ctypes; ctypes.CDLL("libGL.so.1"); ctypes.CDLL("libEGL.so.1")' 2>/dev/null; then
	    apt_install libgl1 libegl1 || echo "The editor's window needs libGL and libEGL: install the packages libgl1 and libegl1."
	fi
	echo "Compiling the kernels (a minute or two, once)"
	$(PYTHON) -m objectmorpher.system.warm_up
	touch $@

# The kernels are compiled while what only the tests need is installed.
.make/test: .make/venv pyproject.toml research/pyproject.toml
	@echo "Installing ObjectMorpher and its test tools into .venv (minutes, the first time)"
	if [ -n "$(LOCK)" ]; then
	    $(INSTALL) --progress-bar on --require-hashes -r packaging/locks/run-time.txt
	else
	    $(INSTALL) --progress-bar on -e .
	fi
	$(KERNELS) &
	compiling=$$!
	if [ -n "$(LOCK)" ]; then $(INSTALL) --progress-bar on --require-hashes -r "$(LOCK)"; fi
	$(INSTALL) --progress-bar on -e '.[dev]' -e research
	$(APT)
	missing=()
	$(PYTHON) -c 'import ctypes; ctypes.CDLL("libGL.so.1")' 2>/dev/null || missing+=(libgl1)
	$(PYTHON) -c 'import ctypes; ctypes.CDLL("libEGL.so.1")' 2>/dev/null || missing+=(libegl1)
	command -v Xvfb >/dev/null || missing+=(xvfb)
	command -v xdotool >/dev/null || missing+=(xdotool)
	made=(.make/run $@)  # the editor needs less than its tests
	if [ "$$(uname)" = Linux ] && [ $${#missing[@]} -gt 0 ]; then
	    apt_install "$${missing[@]}" || {
	        echo "The tests that draw need these system packages, and are skipped without them: $${missing[*]}"
	        made=()  # looked for again next time
	    }
	fi
	$(REWRITTEN) || echo "pytest rewrites the assertions itself, which takes a little longer"
	wait $$compiling || true  # the tests compile what is missing, and say why they cannot
	[ $${#made[@]} = 0 ] || touch "$${made[@]}"

# The environment, made by the first Python that is new enough.
.make/venv:
	@mkdir -p .make
	$(APT)
	find_python() {
	    for name in python3.13 python3.12 python3.11 python3; do
	        if "$$name" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
	            echo "$$name"
	            return
	        fi
	    done
	    return 1
	}
	if ! $(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null ||
	    ! $(PIP) --version >/dev/null 2>&1; then
	    found=$$(find_python) || { apt_install python3 python3-venv && found=$$(find_python); } ||
	        { echo "ObjectMorpher needs Python 3.11 or newer: install it and call make again." >&2; exit 1; }
	    version=$$("$$found" -c 'import sys; print("python%d.%d" % sys.version_info[:2])')
	    if ! "$$found" -c 'import ensurepip, venv' 2>/dev/null; then
	        apt_install "$$version-venv" ||
	            { echo "$$version cannot make environments here: install the package $$version-venv." >&2; exit 1; }
	    fi
	    echo "Making .venv with $$version"
	    rm -rf .venv
	    "$$found" -m venv .venv
	fi
	touch $@

# Makes the pictures of docs/gallery anew.
.PHONY: gallery
gallery: .make/run
	@$(PYTHON) docs/gallery/make_gallery.py

# Makes the tables and pictures of docs/deformation anew.
.PHONY: ablations
ablations: .make/test
	@$(PYTHON) docs/deformation/make_ablations.py

# Makes docs/rendering and docs/performance.md anew; PAGES=performance makes one of them.
.PHONY: rendering
rendering: .make/test
	@$(PYTHON) docs/rendering/make_rendering.py $(PAGES)

# Makes the pages about selection, matting, lifting, registration and formats anew, which measure
# against known truths; PAGES="matting lifting" makes some of them.
.PHONY: evidence
evidence: .make/test
	@for page in $(or $(PAGES),selection matting lifting registration formats compositing); do
	    $(PYTHON) docs/$$page/make_$$page.py
	done

# Makes the table of docs/models.md anew: what each network takes, counted at its real size.
.PHONY: estimates
estimates: .make/models
	@$(PYTHON) docs/estimates/make_estimates.py

# Runs the networks at their real sizes, with random weights, on the device that there is, and writes
# what they took into docs/models.md; NETWORKS="pixelhacker qwen" runs some.
.PHONY: measured
measured: .make/models
	@$(PYTHON) docs/estimates/measure_networks.py $(NETWORKS)

# Does the edits of docs/tour again in a window of their own, and takes the pictures of it and of
# the README; STORIES="dark views" does some of them.
.PHONY: tour
tour: .make/test
	@$(PYTHON) docs/tour/make_tour.py $(STORIES)

# Measures how the window feels, on a machine that has nothing else to do: docs/tour/feel.md.
.PHONY: feel
feel: .make/test
	@$(PYTHON) docs/tour/make_feel.py

# Builds the pages of docs/ as a site in build/site; a broken link or an unknown name is an error.
# Its tools have an environment of their own: the program needs none of them.
.PHONY: docs
SITE := .make/docs/bin/python
docs: .make/docs.stamp
	@NO_MKDOCS_2_WARNING=1 $(SITE) -m mkdocs build --strict --quiet
	echo "The pages are in build/site"

.make/docs.stamp: .make/venv pyproject.toml
	@$(PYTHON) -m venv .make/docs
	extra=$$($(PYTHON) -c 'import tomllib; print(*tomllib.load(open("pyproject.toml", "rb"))["project"]["optional-dependencies"]["docs"], sep="\n")')
	mapfile -t wanted <<< "$$extra"
	$(SITE) -m pip --disable-pip-version-check install -q "$${wanted[@]}"
	touch $@

# Makes the figures of docs/concepts anew, with the program itself.
.PHONY: figures
figures: .make/test
	@$(PYTHON) docs/concepts/make_figures.py

# Damages files of every kind and has them read: docs/reliability-tests.md. SECONDS says for how long.
.PHONY: fuzz
fuzz: .make/test
	@$(PYTHON) -m tests.fuzz --seconds $(or $(SECONDS),600) $(ARGS)

# Runs the command line with values that nobody means: docs/reliability-tests.md. RUNS says how often.
.PHONY: fuzz-options
fuzz-options: .make/test
	@$(PYTHON) -m tests.fuzz.options --runs $(or $(RUNS),20000) $(ARGS)

# Has sessions read that an attacker made, and measures memory and time.
.PHONY: fuzz-sessions
fuzz-sessions: .make/test
	@$(PYTHON) -m tests.fuzz.hostile $(ARGS)

# Lets a monkey play with the window: EVENTS says how often it does something.
.PHONY: monkey
monkey: .make/test
	@$(COMPILE)
	PYTHONPATH=. $(PYTHON) tests/app/monkey.py --events $(or $(EVENTS),20000) $(ARGS)

# Plays random sessions of an artist: nothing moves that was not touched. SESSIONS says how many.
.PHONY: sessions
sessions: .make/test
	@$(COMPILE)
	SESSIONS=$(or $(SESSIONS),2000) $(PYTHON) -m pytest -q -n 0 tests/app/test_random_sessions.py

# Lets every system call go wrong with which something is written; ARGS=--power cuts the power.
.PHONY: faults
faults: .make/test
	@$(PYTHON) -m tests.faults $(ARGS)

# The installers for this system, into dist/: a folder with the program, a Debian package, and an
# AppImage (APPIMAGE_RUNTIME names the AppImage project's run-time file). docs/install.md
.PHONY: packages
KINDS ?= folder deb appimage
packages: .make/packaging/ready
	@.make/packaging/bin/python packaging/build.py $(KINDS)

# Of the oldest Python that we support and the system's own, whose libraries are shipped.
PACKAGED_PYTHON ?= python3.11
.make/packaging/ready: packaging/locks/packaging.txt
	@mkdir -p .make
	rm -rf .make/packaging
	$(PACKAGED_PYTHON) -m venv .make/packaging
	.make/packaging/bin/python -m pip install -q --require-hashes -r packaging/locks/packaging.txt
	touch $@

# Versions and hashes of all that installers and tests hold; UPGRADE=1 asks for the newest.
.PHONY: locks
locks: .make/packaging/uv
	@UV=.make/packaging/uv/bin/uv UPGRADE=$(UPGRADE) packaging/make_locks.sh

.make/packaging/uv:
	@mkdir -p .make/packaging
	$(PACKAGED_PYTHON) -m venv $@
	$@/bin/python -m pip install -q uv

# What is needed to run: the table of licences, a bill of materials (CycloneDX), and what is known
# of weaknesses, where the service that knows answers.
.PHONY: supply-chain
supply-chain: .make/packaging/ready
	@mkdir -p dist
	.make/packaging/bin/python packaging/licences.py | tee dist/licences.txt
	.make/packaging/bin/cyclonedx-py requirements packaging/locks/run-time.txt --pyproject pyproject.toml \
	    --of JSON -o dist/objectmorpher.cdx.json
	.make/packaging/bin/pip-audit -r packaging/locks/run-time.txt --no-deps --disable-pip ||
	    echo "Weaknesses were found, or could not be looked up"
