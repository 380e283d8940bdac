//! Results of decisions, in the form that data use.

use std::time::Duration;

use canopen::emcy::EmcyCode;
use canopen::{Abort, NmtState};

/// A result of a decision. A type that data cannot write keeps the default methods.
pub(crate) trait Settable: Sized {
    /// The values that data can give, such as "`true` or `false`"; `None` when data cannot give
    /// any.
    fn expected() -> Option<String> {
        None
    }

    /// The result that is written so; `None` when it is none.
    fn read(_text: &str) -> Option<Self> {
        None
    }
}

/// Results with one word each.
macro_rules! words {
    ($type:ty: $($word:literal => $value:expr),* $(,)?) => {
        impl crate::decisions::Settable for $type {
            fn expected() -> Option<String> {
                Some([$(concat!("`", $word, "`")),*].join(" or "))
            }

            fn read(text: &str) -> Option<Self> {
                match text {
                    $($word => Some($value),)*
                    _ => None,
                }
            }
        }
    };
}
pub(crate) use words;

words! { bool: "true" => true, "false" => false }
words! { NmtState:
    "initialising" => Self::INITIALISING,
    "pre-operational" => Self::PRE_OPERATIONAL,
    "operational" => Self::OPERATIONAL,
    "stopped" => Self::STOPPED,
}

/// A whole number as it is written, `0x` for hexadecimal ones.
fn whole<T: TryFrom<i128>>(text: &str) -> Option<T> {
    let number = match text.strip_prefix("0x") {
        Some(digits) => i128::from_str_radix(digits, 16),
        None => text.parse(),
    };
    number.ok()?.try_into().ok()
}

macro_rules! whole_numbers {
    ($($type:ty),*) => {
        $(
            impl Settable for $type {
                fn expected() -> Option<String> {
                    Some(format!("a whole number from {} to {}", Self::MIN, Self::MAX))
                }

                fn read(text: &str) -> Option<Self> {
                    whole(text)
                }
            }
        )*
    };
}
whole_numbers!(u8, u16, u32, u64, usize, i32, i64);

impl Settable for f64 {
    fn expected() -> Option<String> {
        Some("a number".to_owned())
    }

    fn read(text: &str) -> Option<Self> {
        text.parse().ok()
    }
}

impl Settable for Abort {
    fn expected() -> Option<String> {
        Some("an abort code such as 0x06090030".to_owned())
    }

    fn read(text: &str) -> Option<Self> {
        text.starts_with("0x").then(|| whole(text)).flatten().map(Self)
    }
}

impl Settable for EmcyCode {
    fn expected() -> Option<String> {
        Some("an error code such as 0x8130".to_owned())
    }

    fn read(text: &str) -> Option<Self> {
        text.starts_with("0x").then(|| whole(text)).flatten().map(Self)
    }
}

/// A time in whole milliseconds, such as `20 ms`.
impl Settable for Duration {
    fn expected() -> Option<String> {
        Some("a time such as `20 ms`".to_owned())
    }

    fn read(text: &str) -> Option<Self> {
        let milliseconds = text.strip_suffix("ms")?.trim_end().parse().ok()?;
        Some(Self::from_millis(milliseconds))
    }
}

impl<T: Settable> Settable for Option<T> {
    fn expected() -> Option<String> {
        let some = T::expected().map(|some| format!(" or {some}")).unwrap_or_default();
        Some(format!("`none`{some}"))
    }

    fn read(text: &str) -> Option<Self> {
        if text == "none" { Some(None) } else { T::read(text).map(Some) }
    }
}

/// `taken`, or the abort code with which it is refused.
impl Settable for Result<(), Abort> {
    fn expected() -> Option<String> {
        Abort::expected().map(|code| format!("`taken` or {code}"))
    }

    fn read(text: &str) -> Option<Self> {
        if text == "taken" { Some(Ok(())) } else { Abort::read(text).map(Err) }
    }
}

/// Results that data cannot write.
macro_rules! in_code_alone {
    ($($type:ty),* $(,)?) => {
        $(impl crate::decisions::Settable for $type {})*
    };
}
pub(crate) use in_code_alone;

impl<A, B> Settable for (A, B) {}
impl<A, B, C> Settable for (A, B, C) {}
impl<A, const N: usize> Settable for [A; N] {}
impl<A> Settable for std::ops::RangeInclusive<A> {}
in_code_alone! {
    canopen::Instant,
    canopen::Mux,
    canopen::lss::Request,
    canopen::nmt::Command,
    canopen::sdo::Request,
    canopen::timestamp::TimeOfDay,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_are_read_as_they_are_written() {
        assert_eq!(bool::read("true"), Some(true));
        assert_eq!(bool::read("yes"), None);
        assert_eq!([u8::read("0x1F"), u8::read("256"), u8::read("x")], [Some(0x1F), None, None]);
        assert_eq!(i64::read("-5"), Some(-5));
        assert_eq!(f64::read("0.003"), Some(0.003));
        assert_eq!(Abort::read("0x06090030"), Some(Abort::VALUE));
        assert_eq!(Abort::read("6"), None);
        assert_eq!(NmtState::read("stopped"), Some(NmtState::STOPPED));
        assert_eq!(Duration::read("20 ms"), Some(Duration::from_millis(20)));
        assert_eq!([Option::<u8>::read("none"), Option::read("4")], [Some(None), Some(Some(4))]);
        assert_eq!(Result::<(), Abort>::read("taken"), Some(Ok(())));
        assert_eq!(Mux::read("0"), None);
        assert_eq!(Option::<u8>::expected().unwrap(), "`none` or a whole number from 0 to 255");
    }

    use canopen::Mux;
}
