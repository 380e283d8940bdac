#!/bin/bash -eu
# Builds every fuzz target with its seeds, as ClusterFuzzLite wants them in $OUT.

# The toolchain of the project is a stable one.
export RUSTC_BOOTSTRAP=1

cd "$SRC/harness/fuzz"
cargo fuzz build --release
for source in fuzz_targets/*.rs; do
    target=$(basename "$source" .rs)
    cp "target/x86_64-unknown-linux-gnu/release/$target" "$OUT/"
    zip --quiet --junk-paths "$OUT/${target}_seed_corpus.zip" "corpus/$target"/*
done
