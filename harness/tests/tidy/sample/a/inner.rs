//! A path in a body. What strings name is no import: "crate::c::C".

pub struct Inner;

pub fn other<'a>(text: &'a str) -> char {
    crate::b::take::<'a>(text, 'x', '\'')
}
