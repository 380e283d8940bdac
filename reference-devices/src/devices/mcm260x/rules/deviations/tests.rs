use super::*;

#[test]
fn every_name_is_used_once() {
    let mut all: Vec<&str> = names().collect();
    let count = all.len();
    all.sort_unstable();
    all.dedup();
    assert_eq!(all.len(), count);
    assert!(all.iter().all(|name| named(name).is_some()));
    assert!(named("none-of-these").is_none());
}
