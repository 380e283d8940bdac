//! What becomes of an operator, a method, a number.

use syn::BinOp;

/// Other operators that a mistake would put in the place of this one.
pub fn binary(op: &BinOp) -> &'static [&'static str] {
    match op {
        BinOp::Lt(_) => &["<=", ">="],
        BinOp::Le(_) => &["<", ">"],
        BinOp::Gt(_) => &[">=", "<="],
        BinOp::Ge(_) => &[">", "<"],
        BinOp::Eq(_) => &["!=", ">="],
        BinOp::Ne(_) => &["==", ">"],
        BinOp::Add(_) => &["-"],
        BinOp::Sub(_) => &["+"],
        BinOp::Mul(_) => &["/", "+"],
        BinOp::Div(_) => &["*"],
        BinOp::Rem(_) => &["/"],
        BinOp::BitAnd(_) => &["|", "^"],
        // `^` puts the same bits together, since they do not overlap.
        BinOp::BitOr(_) => &["&"],
        BinOp::BitXor(_) => &["|"],
        BinOp::Shl(_) => &[">>"],
        BinOp::Shr(_) => &["<<"],
        BinOp::And(_) => &["||"],
        BinOp::Or(_) => &["&&"],
        BinOp::AddAssign(_) => &["-="],
        BinOp::SubAssign(_) => &["+="],
        BinOp::MulAssign(_) => &["/="],
        BinOp::BitAndAssign(_) => &["|="],
        BinOp::BitOrAssign(_) => &["&=", "="],
        BinOp::BitXorAssign(_) => &["|="],
        _ => &[],
    }
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

/// What a function returns that does nothing, for the head of its return type.
pub fn results(head: &str, whole: &str) -> &'static [&'static str] {
    match head {
        "bool" => &["true", "false"],
        "Option" => &["None"],
        "Result" if whole.replace(' ', "").starts_with("Result<(),") => &["Ok(())"],
        "u8" | "u16" | "u32" | "u64" | "u128" | "usize" | "i8" | "i16" | "i32" | "i64" | "i128"
        | "isize" => &["0", "1"],
        "f32" | "f64" => &["0.0", "1.0"],
        "Vec" => &["Vec::new()"],
        "Duration" => &["Duration::ZERO"],
        _ => &[],
    }
}
