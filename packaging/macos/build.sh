#!/usr/bin/env bash
# Makes dist/ObjectMorpher-VERSION-ARCH.dmg. UNTESTED: written for CI, never run yet.
# Needs Python 3.11 and `brew install create-dmg`. To sign and notarise, set SIGN_AS to the name of a
# Developer ID certificate and NOTARY_PROFILE to one kept by `xcrun notarytool store-credentials`.
set -euo pipefail
cd "$(dirname "$0")/../.."

python3.11 -m venv .make/packaging
python=.make/packaging/bin/python
"$python" -m pip install --require-hashes -r packaging/locks/packaging.txt
"$python" packaging/build.py folder
version=$("$python" -c 'import objectmorpher; print(objectmorpher.__version__)')
bundle=dist/ObjectMorpher.app
program=$bundle/Contents/MacOS/objectmorpher

# It starts, computes, and starts processes of its own, before anybody gets it.
"$program" --version
"$program" edit assets/samples/coffee.jpg --click 280,150 --turn 15,0,0 -o dist/edited.png
"$program" -m pip --version

if [ -n "${SIGN_AS:-}" ]; then # kernels are compiled while it runs: see the entitlements
    codesign --force --deep --options runtime --timestamp --sign "$SIGN_AS" \
        --entitlements packaging/macos/entitlements.plist "$bundle"
fi
target=dist/ObjectMorpher-$version-$(uname -m).dmg
rm -f "$target"
create-dmg --volname ObjectMorpher --volicon dist/icon.icns --window-size 540 360 --icon-size 96 \
    --icon ObjectMorpher.app 140 160 --app-drop-link 400 160 "$target" "$bundle"
if [ -n "${NOTARY_PROFILE:-}" ]; then
    xcrun notarytool submit "$target" --keychain-profile "$NOTARY_PROFILE" --wait
    xcrun stapler staple "$target"
fi
ls -l "$target"
