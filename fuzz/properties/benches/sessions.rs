//! `cargo bench -p properties`: how fast the fuzz targets are that hold a session.

use std::fs;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};

/// How often in a second a fuzz target with a session in it can be executed: each of its seeds in
/// turn.
fn fuzz_sessions(bench: &mut Criterion) {
    let corpus = concat!(env!("CARGO_MANIFEST_DIR"), "/../corpus");
    let mut group = bench.benchmark_group("fuzz sessions");
    for name in ["block_transfer", "lss_session", "sdo_client_server", "sdo_server_session"] {
        let (_, property) =
            properties::ALL.iter().find(|(other, _)| *other == name).expect("a property");
        let folder = fs::read_dir(format!("{corpus}/{name}")).expect("a corpus");
        let seeds: Vec<Vec<u8>> =
            folder.map(|file| fs::read(file.expect("a file").path()).expect("a seed")).collect();
        group.throughput(Throughput::Elements(seeds.len() as u64));
        group.bench_function(name, |bench| {
            bench.iter(|| seeds.iter().for_each(|seed| property(seed)))
        });
    }
    group.finish();
}

criterion_group!(benches, fuzz_sessions);
criterion_main!(benches);
