# make run               opens the editor on a sample photo; PHOTO=my.jpg opens that one
# make test              sets everything up and runs the tests; ARGS="-k session" runs some
#
# Both work in a fresh clone: they make .venv and install into it. A second call is fast.

SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.ONESHELL:
.PHONY: run test help
.DEFAULT_GOAL := help

PYTHON := .venv/bin/python
PIP := $(PYTHON) -m pip --disable-pip-version-check
PHOTO ?=
ARGS ?=

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
	@sed -n 's/^# //p' Makefile | head -2

run: .make/run
	@$(PYTHON) -m app models get || echo "The learned models could not be fetched; the built-in methods are used instead."
	if [ -n "$(PHOTO)" ]; then exec $(PYTHON) -m app "$(PHOTO)"; else exec $(PYTHON) -m app --sample; fi

test: .make/test
	@$(PYTHON) -m pytest -m "not slow" $(ARGS)

.make/run: .make/venv pyproject.toml
	@echo "Installing ObjectMorpher into .venv (minutes, the first time)"
	$(PIP) install --progress-bar on -e .
	$(APT)
	if [ "$$(uname)" = Linux ] && [ -n "$${DISPLAY:-}$${WAYLAND_DISPLAY:-}" ] &&
	    ! $(PYTHON) -c 'import ctypes; ctypes.CDLL("libGL.so.1"); ctypes.CDLL("libEGL.so.1")' 2>/dev/null; then
	    apt_install libgl1 libegl1 || echo "The editor's window needs libGL and libEGL: install the packages libgl1 and libegl1."
	fi
	echo "Compiling the kernels (a minute or two, once)"
	$(PYTHON) -m app.warm_up
	touch $@

.make/test: .make/venv pyproject.toml
	@echo "Installing ObjectMorpher and its test tools into .venv (minutes, the first time)"
	$(PIP) install --progress-bar on -e '.[dev]'
	$(APT)
	missing=()
	$(PYTHON) -c 'import ctypes; ctypes.CDLL("libGL.so.1")' 2>/dev/null || missing+=(libgl1)
	$(PYTHON) -c 'import ctypes; ctypes.CDLL("libEGL.so.1")' 2>/dev/null || missing+=(libegl1)
	command -v Xvfb >/dev/null || missing+=(xvfb)
	command -v xdotool >/dev/null || missing+=(xdotool)
	if [ "$$(uname)" = Linux ] && [ $${#missing[@]} -gt 0 ]; then
	    apt_install "$${missing[@]}" || {
	        echo "The tests that draw need these system packages, and are skipped without them: $${missing[*]}"
	        exit 0  # no stamp: looked for again next time
	    }
	fi
	touch .make/run $@  # the editor needs less than its tests

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

# Does the edits of docs/tour again in a window of their own, and takes the pictures of it and of
# the README; STORIES="dark views" does some of them.
.PHONY: tour
tour: .make/test
	@$(PYTHON) docs/tour/make_tour.py $(STORIES)

# Measures how the window feels, on a machine that has nothing else to do: docs/tour/feel.md.
.PHONY: feel
feel: .make/test
	@$(PYTHON) docs/tour/make_feel.py
