//! Values around one: `50 +/- 2`.

use canopen::source::{Decimal, Node};

/// Center minus spread and center plus spread.
pub(super) fn ends(center: &Node, spread: &Node) -> Option<[Node; 2]> {
    let (center, spread) = (Decimal::of(center)?, Decimal::of(spread)?);
    Some([center.minus(spread)?.node(), center.plus(spread)?.node()])
}

/// At most this many values are tolerated around one: they are accepted one by one.
const MOST_AROUND: i128 = 64;

/// The whole numbers around one.
pub(super) fn around(center: i128, spread: i128) -> Option<Vec<i128>> {
    let all = (1..=MOST_AROUND).contains(&spread).then(|| center - spread..=center + spread)?;
    Some(all.filter(|value| *value != center).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_around_one() {
        assert_eq!(around(10, 2).unwrap(), [8, 9, 11, 12]);
        assert_eq!(around(10, 100), None);
        let ends = |center: &str, spread: &str| ends(&Node::from(center), &Node::from(spread));
        let shown = |ends: Option<[Node; 2]>| ends.map(|ends| format!("{ends:?}"));
        assert_eq!(shown(ends("10", "0.5")).unwrap(), r#"[Real(9.5, "9.5"), Real(10.5, "10.5")]"#);
        assert_eq!(shown(ends("word", "1")), None);
    }
}
