//! Limits of an XML text. The library for trees compares attributes and namespaces of an element
//! each with each, and carries namespaces to the elements below. What no data sheet comes near to
//! is refused before the library sees it.

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

/// The most attributes of an element, namespaces among them. Elements of CiA 311 have at most 15.
const ATTRIBUTES: usize = 256;

/// The most namespaces that an element and those around it declare.
const NAMESPACES: usize = 64;

/// The most elements around each other, counted from the root. Those of CiA 311 are about 10.
const DEPTH: usize = 64;

/// What is too much in a text, and the byte at which that begins.
pub(super) fn excess(text: &str) -> Option<(usize, String)> {
    let mut reader = Reader::from_str(text);
    let config = reader.config_mut();
    // Whether the text is well-formed, the library for trees says.
    config.check_end_names = false;
    config.allow_unmatched_ends = true;
    config.allow_dangling_amp = true;
    // The namespaces of the elements around.
    let mut around: Vec<usize> = Vec::new();
    loop {
        let at = reader.buffer_position() as usize;
        let found = match reader.read_event() {
            Ok(Event::Start(element)) => within(&element, around.iter().sum()).and_then(|own| {
                around.push(own);
                match around.len() > DEPTH {
                    true => Err(format!("elements are nested deeper than {DEPTH}")),
                    false => Ok(()),
                }
            }),
            Ok(Event::Empty(element)) => within(&element, around.iter().sum()).map(|_| ()),
            Ok(Event::End(_)) => {
                around.pop();
                Ok(())
            }
            Ok(Event::DocType(_)) => {
                Err("a document type is declared, which could define entities".to_owned())
            }
            Ok(Event::Eof) | Err(_) => return None,
            Ok(_) => Ok(()),
        };
        if let Err(message) = found {
            return Some((at, message));
        }
    }
}

/// How many namespaces an element declares, below elements with that many.
///
/// # Errors
/// What it has too many of.
fn within(element: &BytesStart<'_>, above: usize) -> Result<usize, String> {
    let (mut all, mut namespaces) = (0, 0);
    // The check of the library compares each name with each.
    for attribute in element.attributes().with_checks(false) {
        all += 1;
        let is_namespace = |key: &[u8]| key == b"xmlns" || key.starts_with(b"xmlns:");
        namespaces += usize::from(attribute.is_ok_and(|it| is_namespace(it.key.as_ref())));
        if all > ATTRIBUTES {
            return Err(format!("an element has more than {ATTRIBUTES} attributes"));
        }
    }
    match above + namespaces > NAMESPACES {
        true => Err(format!("more than {NAMESPACES} namespaces are declared around an element")),
        false => Ok(namespaces),
    }
}
