#!/usr/bin/env bash
# Runs the unit tests of the kernels, which contain all unsafe code, under valgrind: no access out of bounds, and no
# read of uninitialised memory. Valgrind supports AVX2, but not AVX-512.
set -euo pipefail
cd "$(dirname "$0")/.."

if ! valgrind --version >/dev/null 2>&1; then
    echo "not checked: valgrind is not installed"
    exit 0
fi
runner="['valgrind', '--quiet', '--error-exitcode=1']"
cargo --config "target.'cfg(all())'.runner=$runner" test --release --workspace --lib -- learn::kernels learn::networks::mlp
