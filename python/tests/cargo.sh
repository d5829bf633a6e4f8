#!/bin/sh
# The cargo that maturin calls for the wheel of the tests. For one package alone the dependencies would have other features, and all be
# compiled anew: this builds the workspace as its tests do, where nearly everything is there already.
set -eu
case $1 in
    rustc)
        # What maturin says of the interpreter does not change a module for all of them, but has PyO3 compiled anew.
        unset PYO3_PYTHON PYO3_ENVIRONMENT_SIGNATURE PYO3_BUILD_EXTENSION_MODULE PYO3_CONFIG_FILE
        exec cargo build --workspace --lib --tests --locked --message-format json-render-diagnostics
        ;;
    *) exec cargo "$@" ;;
esac
