//! What a function returns that does nothing.

use syn::{GenericArgument, PathArguments, Type};

use crate::operators::Set;

/// The values that cargo-mutants returns instead, and a few that it does not.
pub fn results(of: &Type, source: &dyn Fn(&Type) -> String) -> Vec<(Set, String)> {
    let mut results: Vec<_> =
        values(of, source).into_iter().map(|value| (Set::CargoMutants, value)).collect();
    if source(of) == "Duration" {
        results.push((Set::Further, "Duration::ZERO".to_owned()));
    }
    results
}

fn values(of: &Type, source: &dyn Fn(&Type) -> String) -> Vec<String> {
    let within = |pattern: &str, of: &Type| -> Vec<String> {
        values(of, source).iter().map(|value| pattern.replace('_', value)).collect()
    };
    match of {
        Type::Tuple(tuple) => {
            let start = vec![String::new()];
            let elements = tuple.elems.iter().fold(start, |before, element| {
                let next = values(element, source);
                let joined = before
                    .iter()
                    .flat_map(|before| next.iter().map(move |value| format!("{before}{value}, ")));
                joined.collect()
            });
            elements.into_iter().map(|elements| format!("({elements})")).collect()
        }
        Type::Array(array) => {
            let of = values(&array.elem, source);
            let whole = source(&Type::Array(array.clone()));
            let length = whole.rsplit_once(';').map_or("0", |(_, length)| length);
            of.iter().map(|value| format!("[{value};{length}")).collect()
        }
        Type::Reference(reference) => match &*reference.elem {
            Type::Slice(slice) => {
                let mut all = vec!["Vec::leak(Vec::new())".to_owned()];
                all.extend(within("Vec::leak(vec![_])", &slice.elem));
                all
            }
            Type::Path(path) if path.path.is_ident("str") => {
                vec!["\"\"".to_owned(), "\"xyzzy\"".to_owned()]
            }
            Type::TraitObject(_) => Vec::new(),
            other => within("Box::leak(Box::new(_))", other),
        },
        Type::Path(path) => {
            let Some(last) = path.path.segments.last() else { return Vec::new() };
            let inner: Vec<_> = match &last.arguments {
                PathArguments::AngleBracketed(list) => list
                    .args
                    .iter()
                    .filter_map(|argument| match argument {
                        GenericArgument::Type(inner) => Some(inner),
                        _ => None,
                    })
                    .collect(),
                _ => Vec::new(),
            };
            let inner = inner.first();
            let first = |pattern| inner.map_or_else(Vec::new, |of| within(pattern, of));
            let fixed = |values: &[&str]| values.iter().map(|&value| value.to_owned()).collect();
            match last.ident.to_string().as_str() {
                "bool" => fixed(&["true", "false"]),
                "u8" | "u16" | "u32" | "u64" | "u128" | "usize" => fixed(&["0", "1"]),
                "i8" | "i16" | "i32" | "i64" | "i128" | "isize" => fixed(&["0", "1", "-1"]),
                "f32" | "f64" => fixed(&["0.0", "1.0", "-1.0"]),
                "String" => fixed(&["String::new()", "\"xyzzy\".into()"]),
                "Option" => [fixed(&["None"]), first("Some(_)")].concat(),
                "Result" => first("Ok(_)"),
                "Box" => first("Box::new(_)"),
                "Rc" => first("Rc::new(_)"),
                "Arc" => first("Arc::new(_)"),
                "Vec" => [fixed(&["vec![]"]), first("vec![_]")].concat(),
                _ => fixed(&["Default::default()"]),
            }
        }
        _ => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(text: &str) -> Vec<String> {
        let parsed = syn::parse_str(text).unwrap();
        values(&parsed, &|_| text.to_owned())
    }

    #[test]
    fn types_have_values() {
        assert_eq!(of("Option<bool>"), ["None", "Some(true)", "Some(false)"]);
        assert_eq!(of("Result<(), Abort>"), ["Ok(())"]);
        assert_eq!(of("(u8, Id)"), ["(0, Default::default(), )", "(1, Default::default(), )"]);
        assert_eq!(of("[u8; 4]"), ["[0; 4]", "[1; 4]"]);
        assert_eq!(
            of("&[u8]"),
            ["Vec::leak(Vec::new())", "Vec::leak(vec![0])", "Vec::leak(vec![1])"]
        );
    }
}
