//! Places of a source file, and how the file reads with a switch at each of them.

use std::ops::Range;

/// Something that is written around a part of the text, or instead of it.
#[derive(Debug)]
pub struct Site {
    /// The part of the text, in bytes.
    pub range: Range<usize>,
    /// What comes before it.
    pub before: String,
    /// What comes after it.
    pub after: String,
    /// Whether the part itself is left out.
    pub left_out: bool,
}

impl Site {
    /// Text between two characters.
    pub fn insertion(at: usize, text: String) -> Self {
        Self { range: at..at, before: text, after: String::new(), left_out: false }
    }
}

/// Writes the text with all sites. Of two sites with one range, the first is the outer one.
pub fn render(text: &str, mut sites: Vec<Site>) -> String {
    // A stable sort: outer sites first.
    sites.sort_by_key(|site| (site.range.start, usize::MAX - site.range.end));
    let mut rest = sites.as_slice();
    emit(text, 0..text.len(), &mut rest)
}

fn emit(text: &str, range: Range<usize>, rest: &mut &[Site]) -> String {
    let mut out = String::new();
    let mut at = range.start;
    while let [site, others @ ..] = *rest
        && site.range.start >= range.start
        && site.range.end <= range.end
    {
        *rest = others;
        out += &text[at..site.range.start];
        out += &site.before;
        let inner = emit(text, site.range.clone(), rest);
        if !site.left_out {
            out += &inner;
        }
        out += &site.after;
        at = site.range.end;
    }
    out += &text[at..range.end];
    out
}

/// What stands in a rendered text for a mutant, with its number as a comment on both sides, so that
/// a message of the compiler leads to it.
pub fn alternative(id: usize, text: &str) -> String {
    format!("/*<{id}*/ {text} /*{id}>*/")
}

/// The mutants of a rendered text, with the bytes that their alternatives take.
pub fn alternatives(rendered: &str) -> Vec<(usize, Range<usize>)> {
    let mut found = Vec::new();
    let mut open: Vec<(usize, usize)> = Vec::new();
    for (at, _) in rendered.match_indices("/*") {
        let Some(length) = rendered[at..].find("*/") else { continue };
        let comment = &rendered[at + 2..at + length];
        if let Some(id) = comment.strip_prefix('<').and_then(|id| id.parse().ok()) {
            open.push((id, at));
        } else if let Some(id) = comment.strip_suffix('>').and_then(|id| id.parse().ok())
            && let Some(place) = open.iter().rposition(|(opened, _)| *opened == id)
        {
            found.push((id, open.remove(place).1..at + length));
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn site(range: Range<usize>, before: &str, after: &str) -> Site {
        Site { range, before: before.into(), after: after.into(), left_out: false }
    }

    #[test]
    fn sites_are_nested() {
        let sites = vec![site(0..1, "(", ")"), site(0..5, "[", "]"), site(0..5, "{", "}")];
        assert_eq!(render("a + b;", sites), "[{(a) + b}];");
        let mut constant = site(0..6, "", "");
        constant.left_out = true;
        let sites = vec![constant, Site::insertion(12, "!".into())];
        assert_eq!(render("const fn a {}", sites), "fn a {!}");
    }

    #[test]
    fn alternatives_are_found_again() {
        let text = format!("if m(1) {{ {} }}", alternative(1, "a"));
        let found = alternatives(&text);
        assert_eq!(found.len(), 1);
        assert_eq!((found[0].0, &text[found[0].1.clone()]), (1, "/*<1*/ a /*1>"));
    }
}
