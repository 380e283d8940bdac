//! What becomes of an operator, a method, a number.

use clap::ValueEnum;
use serde::{Deserialize, Serialize};
use syn::BinOp;

/// The origin of the rule that a change follows.
#[derive(Clone, Copy, Debug, Deserialize, Eq, PartialEq, Serialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Set {
    /// One of those that cargo-mutants makes.
    CargoMutants,
    /// One of our own.
    Further,
}

/// Other operators in the place of this one: those of cargo-mutants, then others that a mistake
/// would put there.
///
/// cargo-mutants makes `^` of `|`, too. It puts the same bits together where they do not overlap,
/// so it is left out.
pub fn binary(op: &BinOp) -> impl Iterator<Item = (Set, &'static str)> {
    let (standard, further): (&[_], &[_]) = match op {
        BinOp::Lt(_) => (&["==", ">", "<="], &[">="]),
        BinOp::Le(_) => (&[">"], &["<"]),
        BinOp::Gt(_) => (&["==", "<", ">="], &["<="]),
        BinOp::Ge(_) => (&["<"], &[">"]),
        BinOp::Eq(_) => (&["!="], &[">="]),
        BinOp::Ne(_) => (&["=="], &[">"]),
        BinOp::Add(_) => (&["-", "*"], &[]),
        BinOp::Sub(_) => (&["+", "/"], &[]),
        BinOp::Mul(_) => (&["+", "/"], &[]),
        BinOp::Div(_) => (&["%", "*"], &[]),
        BinOp::Rem(_) => (&["/", "+"], &[]),
        BinOp::BitAnd(_) => (&["|", "^"], &[]),
        BinOp::BitOr(_) => (&["&"], &[]),
        BinOp::BitXor(_) => (&["&", "|"], &[]),
        BinOp::Shl(_) => (&[">>"], &[]),
        BinOp::Shr(_) => (&["<<"], &[]),
        BinOp::And(_) => (&["||"], &[]),
        BinOp::Or(_) => (&["&&"], &[]),
        BinOp::AddAssign(_) => (&["-=", "*="], &[]),
        BinOp::SubAssign(_) => (&["+=", "/="], &[]),
        BinOp::MulAssign(_) => (&["+=", "/="], &[]),
        BinOp::BitAndAssign(_) => (&["|=", "^="], &[]),
        BinOp::BitOrAssign(_) => (&["&="], &["="]),
        BinOp::BitXorAssign(_) => (&["|=", "&="], &[]),
        _ => (&[], &[]),
    };
    let standard = standard.iter().map(|op| (Set::CargoMutants, *op));
    standard.chain(further.iter().map(|op| (Set::Further, *op)))
}

/// Whether one of the operands alone is a mutant, as a forgotten condition or part is.
pub fn stands_alone(op: &BinOp) -> bool {
    matches!(op, BinOp::And(_) | BinOp::Or(_) | BinOp::BitAnd(_) | BinOp::BitOr(_) | BinOp::Rem(_))
}

/// Other methods with the same operands. A method `!x` is `x`, negated.
pub fn method(name: &str) -> &'static [&'static str] {
    match name {
        "is_some" => &["is_none"],
        "is_none" => &["is_some"],
        "is_ok" => &["is_err"],
        "is_err" => &["is_ok"],
        "is_some_and" => &["is_none_or"],
        "is_none_or" => &["is_some_and"],
        "min" => &["max"],
        "max" => &["min"],
        "any" => &["all"],
        "all" => &["any"],
        "first" => &["last"],
        "last" => &["first"],
        "saturating_add" => &["wrapping_add", "saturating_sub"],
        "saturating_sub" => &["wrapping_sub", "saturating_add"],
        "wrapping_add" => &["wrapping_sub", "saturating_add"],
        "wrapping_sub" => &["wrapping_add", "saturating_sub"],
        "to_le_bytes" => &["to_be_bytes"],
        "to_be_bytes" => &["to_le_bytes"],
        "position" => &["rposition"],
        "rposition" => &["position"],
        "insert" => &["get_or_insert"],
        "get_or_insert" => &["insert"],
        "and" => &["or"],
        "or" => &["and", "xor"],
        "take_if" => &["filter"],
        "div_euclid" => &["rem_euclid"],
        "starts_with" => &["ends_with"],
        "ends_with" => &["starts_with"],
        "is_empty" | "is_zero" | "contains" | "contains_key" | "eq" => &["!"],
        _ => &[],
    }
}

/// Methods without which the receiver has the same type, or a reference that works as well.
pub fn can_be_left_out(name: &str) -> bool {
    matches!(
        name,
        "filter"
            | "or"
            | "or_else"
            | "min"
            | "max"
            | "clamp"
            | "rev"
            | "skip"
            | "take"
            | "abs"
            | "unsigned_abs"
            | "rem_euclid"
            | "saturating_sub"
            | "saturating_add"
            | "wrapping_add"
            | "wrapping_sub"
            | "pow"
    )
}

/// Numbers that stand for off by one and for forgotten.
pub fn numbers(value: u128) -> Vec<u128> {
    let mut others = vec![value + 1];
    others.extend(value.checked_sub(1));
    if value > 1 {
        others.push(0);
    }
    others
}

/// The type that has half the bits.
pub fn narrower(name: &str) -> Option<&'static str> {
    Some(match name {
        "usize" | "u16" => "u8",
        "u32" => "u16",
        "u64" => "u32",
        "i16" => "i8",
        "i32" => "i16",
        "i64" => "i32",
        _ => return None,
    })
}
