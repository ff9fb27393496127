#!/usr/bin/env bash
# Runs the unit tests of the kernels, where all unsafe code is, under valgrind: no read or write out of bounds, and
# nothing read before it is written. Valgrind has AVX2 and no AVX-512.
set -euo pipefail
cd "$(dirname "$0")/.."

if ! valgrind --version >/dev/null 2>&1; then
    echo "not checked: valgrind is not installed"
    exit 0
fi
runner="['valgrind', '--quiet', '--error-exitcode=1']"
cargo --config "target.'cfg(all())'.runner=$runner" test --release --lib -- learn::kernel learn::product learn::mlp
