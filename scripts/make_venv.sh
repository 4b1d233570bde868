#!/bin/sh
# usage: make_venv.sh VENV [PYTHON]
# Make the virtual environment VENV with PYTHON, or with the first interpreter that suits. One that works is kept.
set -eu
venv=$1
wanted=${2-}

suits='import ensurepip, sys, venv; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 14))'
version='import sys; print(*sys.version_info[:2], sep=".")'

# Found by running it: a name on PATH may be a shim without a Python behind it, and a Python may come without venv.
works() { "$1" -c "$suits" >/dev/null 2>&1; }

keeps() {
    works "$venv/bin/python" && "$venv/bin/python" -m pip --version >/dev/null 2>&1 || return 1
    [ -z "$wanted" ] || [ "$("$venv/bin/python" -c "$version")" = "$("$wanted" -c "$version" 2>/dev/null)" ]
}

make_with() {
    echo "making $venv with $1 ($("$1" -c "$version"))"
    "$1" -m venv --clear "$venv"
}

if keeps; then
    exit
elif [ -n "$wanted" ]; then
    if works "$wanted"; then make_with "$wanted"; exit; fi
    tried=$wanted
else
    tried="python3.14 python3.13 python3.12 python3.11 python3"
    for python in $tried; do
        if works "$python"; then make_with "$python"; exit; fi
    done
fi
echo "slam-uwb needs Python 3.11 to 3.14 with venv (tried: $tried); to install it: apt install python3 python3-venv, or brew install python" >&2
exit 1
