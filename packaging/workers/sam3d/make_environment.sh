#!/usr/bin/env bash
# Makes the environment of SAM 3D Objects, with the publishers' own steps (their doc/setup.md), and
# what the worker needs: `make_environment.sh FOLDER`, where the clone is put. Needs git, conda or
# mamba, Linux, and an NVIDIA driver of CUDA 12.1 or later; about 25 GB of disk and 20 minutes. The
# weights come last: their licence has to be accepted on their page, and HF_TOKEN to be set.
set -euo pipefail
root=${1:?usage: make_environment.sh FOLDER}
commit=0519b504127b54df957338514bfa9ad29e77f476
here=$(cd "$(dirname "$0")" && pwd)
tool=$(command -v mamba || command -v conda || true)
[ -n "$tool" ] || { echo "neither mamba nor conda is installed" >&2; exit 1; }
free=$(df -Pk "$(dirname "$root")" | awk 'NR == 2 {print int($4 / 1048576)}')
[ "$free" -ge 25 ] || { echo "25 GB are needed beside $root, $free GB are free" >&2; exit 1; }
[ -d "$root/.git" ] || git clone https://github.com/facebookresearch/sam-3d-objects "$root"
git -C "$root" checkout -q "$commit"
"$tool" env create -y -p "$here/env" -f "$root/environments/default.yml"
cd "$root"
export PIP_EXTRA_INDEX_URL="https://pypi.ngc.nvidia.com https://download.pytorch.org/whl/cu121"
"$here/env/bin/pip" install -e '.[dev]'
"$here/env/bin/pip" install -e '.[p3d]'
export PIP_FIND_LINKS="https://nvidia-kaolin.s3.us-east-2.amazonaws.com/torch-2.5.1_cu121.html"
"$here/env/bin/pip" install -e '.[inference]'
[ ! -x patching/hydra ] || PATH="$here/env/bin:$PATH" ./patching/hydra
"$here/env/bin/pip" install 'huggingface-hub[cli]<1.0'
PATH="$here/env/bin:$PATH" hf download --repo-type model --local-dir checkpoints/hf-download \
    --max-workers 1 facebook/sam-3d-objects
[ -d checkpoints/hf ] || mv checkpoints/hf-download/checkpoints checkpoints/hf
echo "Ready: export SAM3D_ROOT=$root"
