# Makes dist\ObjectMorpher-VERSION-x64.msi. UNTESTED: written for CI, never run yet.
# Needs Python 3.11 and .NET: WiX is fetched as a .NET tool.
#   powershell -File packaging\windows\build.ps1
# To sign, set SIGN to a command that takes a file, such as "signtool sign /a /fd sha256 /tr URL".
$ErrorActionPreference = "Stop"
$PSNativeCommandUseErrorActionPreference = $true
Set-Location (Join-Path $PSScriptRoot "..\..")

py -3.11 -m venv .make\packaging
$python = ".make\packaging\Scripts\python.exe"
& $python -m pip install --require-hashes -r packaging\locks\packaging.txt
& $python packaging\build.py folder
$version = (& $python -c "import objectmorpher; print(objectmorpher.__version__)").Trim()

# It starts, computes, and starts processes of its own, before anybody gets it.
$program = "dist\objectmorpher\objectmorpher.exe"
& $program --version
& $program edit assets\samples\coffee.jpg --click 280,150 --turn 15,0,0 -o dist\edited.png
& $program -m pip --version
if ($env:SIGN) { Invoke-Expression "$env:SIGN $program" }

dotnet tool install --tool-path .make\wix "wix" --version "5.*"
.make\wix\wix.exe build packaging\windows\objectmorpher.wxs -arch x64 `
    -d Version=$version -d Built=(Resolve-Path dist).Path -o "dist\ObjectMorpher-$version-x64.msi"
if ($env:SIGN) { Invoke-Expression "$env:SIGN dist\ObjectMorpher-$version-x64.msi" }
Get-Item dist\*.msi | Select-Object Name, Length
