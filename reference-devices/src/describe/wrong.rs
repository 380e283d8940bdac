//! Mistakes of an object, and where the text with the mistake stands: in the file of the variant or
//! of one of its parts, or else in that of the device.

use std::sync::Arc;

use canopen::Mux;
use canopen::catalogue::{ObjectFacts, keyed};
use canopen::eds::Eds;
use canopen::source::{At, Complaint, Outline, Source};

use super::node::NodeFacts;

/// A mistake in the description of an object.
#[derive(Debug)]
pub(super) struct Wrong {
    mux: Mux,
    about: About,
    message: String,
}

#[derive(Clone, Copy, Debug)]
enum About {
    Object,
    Entry,
    Key(&'static str),
}

impl Wrong {
    /// About an object as a whole.
    pub(super) fn object(index: u16, message: String) -> Self {
        Self { mux: Mux::new(index, 0), about: About::Object, message }
    }

    /// About an entry as a whole.
    pub(super) fn entry(mux: Mux, message: String) -> Self {
        Self { mux, about: About::Entry, message }
    }

    /// About one of the keys that describe an entry.
    pub(super) fn value(mux: Mux, key: &'static str, message: String) -> Self {
        Self { mux, about: About::Key(key), message }
    }

    /// The complaint with its place: the key, if one of the files has it, or else the entry or the
    /// object. A key of an entry takes precedence over one of its object, and the files count in
    /// their order.
    pub(super) fn complaint(self, files: &[&Arc<Source>]) -> Complaint {
        let outlines: Vec<_> =
            files.iter().filter_map(|file| Some((file, Outline::of(file)?))).collect();
        let sub = match self.mux.sub {
            0 => vec!["sub0".to_owned()],
            sub => vec!["subs".to_owned(), sub.to_string()],
        };
        let key = match self.about {
            About::Key(key) => Some(key.to_owned()),
            About::Object | About::Entry => None,
        };
        let of_sub = [sub.clone(), key.clone().into_iter().collect()].concat();
        let candidates = match self.about {
            About::Object => vec![vec![]],
            About::Entry => vec![sub, vec![]],
            About::Key(_) => vec![of_sub, key.into_iter().collect(), sub, vec![]],
        };
        for below in &candidates {
            for (file, outline) in &outlines {
                let Some((list, key)) = object_key(outline, self.mux.index) else { continue };
                let mut path = vec![list, &key];
                path.extend(below.iter().map(String::as_str));
                // The place of a value is the value itself; that of an object or an entry is its
                // key.
                let is_value = below
                    .last()
                    .is_some_and(|last| matches!(self.about, About::Key(key) if key == last));
                let place = if is_value { outline.value(&path) } else { outline.key(&path) };
                if let Some(place) = place {
                    return Complaint::at(file, place, self.message);
                }
            }
        }
        let source = Arc::clone(files[files.len() - 1]);
        Complaint { source, place: None, message: self.message }
    }
}

/// The objects that `node` names in the files of a device.
#[derive(Default)]
pub(super) struct Named(Vec<(Arc<Source>, At<Mux>)>);

impl Named {
    /// Adds those of a file.
    pub(super) fn add(&mut self, source: &Arc<Source>, node: &NodeFacts) {
        self.0.extend(node.objects().map(|at| (Arc::clone(source), at.clone())));
    }

    /// The addresses in use that the device does not have.
    pub(super) fn unknown(&self, used: &[At<Mux>], eds: &Eds) -> Vec<Complaint> {
        let unknown = self.0.iter().filter(|(_, at)| eds.entry(at.value).is_none());
        let unknown = unknown.filter(|(_, at)| used.contains(at));
        let complain = |(source, at): &(Arc<Source>, At<Mux>)| {
            Complaint::at(source, at.place, format!("the device has no object {}", at.value))
        };
        unknown.map(complain).collect()
    }
}

/// The keys under which a text describes the object.
fn object_key(outline: &Outline, index: u16) -> Option<(&'static str, String)> {
    let means = |key: &str| {
        let ranges = keyed(key, ObjectFacts::default()).unwrap_or_default();
        ranges.iter().any(|(range, _)| range.contains(&index))
    };
    let lists = [("objects", ["objects"]), ("replace", ["replace"])];
    lists.into_iter().find_map(|(list, path)| {
        let key = outline.keys(&path).map(|(key, _)| key.to_owned()).find(|key| means(key))?;
        Some((list, key))
    })
}
