//! A YAML text as keys, items and values, each with its place. A notation is expanded on the tree,
//! and any type can be read from the tree as from the text itself.

use std::borrow::Cow;
use std::fmt;

use serde::de::value::{BorrowedStrDeserializer, StrDeserializer};
use serde::de::{
    self, DeserializeSeed, EnumAccess, IntoDeserializer, MapAccess, SeqAccess, VariantAccess,
    Visitor,
};
use serde::{Deserialize, Deserializer};

use super::{At, Lines, Place, Source};

/// A value of the text.
#[derive(Clone, Debug, PartialEq)]
pub struct Tree {
    /// The value.
    pub node: Node,
    /// Where it stands.
    pub place: Place,
}

/// The kinds of value.
#[derive(Clone, Debug, PartialEq)]
pub enum Node {
    /// Keys and values, in their order.
    Map(Vec<(At<String>, Tree)>),
    /// A list.
    List(Vec<Tree>),
    /// A whole number, and how it is written.
    Int(i128, String),
    /// A number with a point, and how it is written.
    Real(f64, String),
    /// `true` or `false`, and how it is written.
    Bool(bool, String),
    /// Any other text.
    Text(String),
    /// Nothing.
    Null,
}

impl Tree {
    /// The text as a tree.
    ///
    /// # Errors
    /// What is wrong with the YAML.
    pub fn of(source: &std::sync::Arc<Source>) -> Result<Self, super::Complaint> {
        let mut tree = super::parse(source)?;
        if tree.node == Node::Null {
            let message = super::in_our_words("unexpected end of input");
            return Err(super::Complaint::at(source, tree.place, message));
        }
        tree.remember(source);
        Ok(tree)
    }

    /// Numbers as they are written: `00 10` and `0x0A` are text to some readers.
    fn remember(&mut self, source: &Source) {
        self.remember_in(&Lines::of_yaml(&source.text));
    }

    fn remember_in(&mut self, lines: &Lines<'_>) {
        match &mut self.node {
            Node::Map(entries) => entries.iter_mut().for_each(|(_, tree)| tree.remember_in(lines)),
            Node::List(items) => items.iter_mut().for_each(|tree| tree.remember_in(lines)),
            Node::Int(_, text) | Node::Real(_, text) | Node::Bool(_, text) => {
                let rest = lines.from(self.place);
                let end = rest.find([',', '}', ']', '#', ':']).unwrap_or(rest.len());
                rest[..end].trim_end().clone_into(text);
            }
            Node::Text(_) | Node::Null => {}
        }
    }

    /// The value of a key; `None` when it is no map, or has no such key.
    pub fn get(&self, key: &str) -> Option<&Self> {
        match &self.node {
            Node::Map(entries) => {
                entries.iter().find(|(known, _)| known.value == key).map(|(_, value)| value)
            }
            _ => None,
        }
    }

    /// Its keys and values; none when it is no map.
    pub fn entries(&self) -> &[(At<String>, Self)] {
        match &self.node {
            Node::Map(entries) => entries,
            _ => &[],
        }
    }

    /// A scalar as it is written; `None` for maps, lists and nothing.
    pub fn text(&self) -> Option<&str> {
        match &self.node {
            Node::Int(_, text) | Node::Real(_, text) | Node::Bool(_, text) | Node::Text(text) => {
                Some(text)
            }
            Node::Map(_) | Node::List(_) | Node::Null => None,
        }
    }

    /// The tree in the form of one line. Text with special characters is quoted.
    pub fn in_one_line(&self) -> String {
        match &self.node {
            Node::Map(entries) => {
                let entry = |(key, value): &(At<String>, Self)| {
                    format!("{}: {}", key.value, value.in_one_line())
                };
                format!("{{ {} }}", entries.iter().map(entry).collect::<Vec<_>>().join(", "))
            }
            Node::List(items) => {
                let items: Vec<String> = items.iter().map(Self::in_one_line).collect();
                format!("[{}]", items.join(", "))
            }
            Node::Text(text) => {
                let plain = |c: char| c.is_alphanumeric() || " -_./$".contains(c);
                if text.chars().all(plain) { text.clone() } else { format!("\"{text}\"") }
            }
            Node::Int(number, text) if text.is_empty() => number.to_string(),
            Node::Real(number, text) if text.is_empty() => number.to_string(),
            Node::Bool(on, text) if text.is_empty() => on.to_string(),
            Node::Int(_, text) | Node::Real(_, text) | Node::Bool(_, text) => text.clone(),
            Node::Null => "~".to_owned(),
        }
    }

    /// Reads something out of the tree.
    ///
    /// # Errors
    /// What does not fit, with its place.
    pub fn read<'de, T: Deserialize<'de>>(&'de self) -> Result<T, Unfit> {
        T::deserialize(self)
    }
}

impl<'de> Deserialize<'de> for Tree {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let At { value: node, place } = At::deserialize(deserializer)?;
        Ok(Self { node, place })
    }
}

impl<'de> Deserialize<'de> for Node {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(NodeVisitor)
    }
}

struct NodeVisitor;

impl<'de> Visitor<'de> for NodeVisitor {
    type Value = Node;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("anything")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Node, A::Error> {
        let mut entries = Vec::new();
        // As text: if read as any type, `on` would be `true`.
        while let Some(entry) = map.next_entry()? {
            entries.push(entry);
        }
        Ok(Node::Map(entries))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Node, A::Error> {
        let mut items = Vec::new();
        while let Some(item) = list.next_element()? {
            items.push(item);
        }
        Ok(Node::List(items))
    }

    fn visit_bool<E>(self, on: bool) -> Result<Node, E> {
        Ok(Node::Bool(on, String::new()))
    }

    fn visit_i64<E>(self, number: i64) -> Result<Node, E> {
        Ok(Node::Int(number.into(), String::new()))
    }

    fn visit_u64<E>(self, number: u64) -> Result<Node, E> {
        Ok(Node::Int(number.into(), String::new()))
    }

    fn visit_f64<E>(self, number: f64) -> Result<Node, E> {
        Ok(Node::Real(number, String::new()))
    }

    fn visit_str<E>(self, text: &str) -> Result<Node, E> {
        Ok(Node::Text(text.to_owned()))
    }

    fn visit_string<E>(self, text: String) -> Result<Node, E> {
        Ok(Node::Text(text))
    }

    fn visit_unit<E>(self) -> Result<Node, E> {
        Ok(Node::Null)
    }

    fn visit_none<E>(self) -> Result<Node, E> {
        Ok(Node::Null)
    }

    fn visit_some<D: Deserializer<'de>>(self, deserializer: D) -> Result<Node, D::Error> {
        Node::deserialize(deserializer)
    }
}

/// The mismatch between a tree and the type that is read from it, in the words of the library.
#[derive(Debug)]
pub struct Unfit {
    /// The mistake.
    pub message: String,
    /// Where.
    pub place: Option<Place>,
}

impl fmt::Display for Unfit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for Unfit {}

impl de::Error for Unfit {
    fn custom<T: fmt::Display>(message: T) -> Self {
        Self { message: message.to_string(), place: None }
    }

    // The YAML library words its message for text, so that one translation serves both.

    fn invalid_type(_: de::Unexpected<'_>, expected: &dyn de::Expected) -> Self {
        Self::custom(format!("invalid {expected}"))
    }

    fn invalid_value(_: de::Unexpected<'_>, expected: &dyn de::Expected) -> Self {
        Self::custom(format!("invalid {expected}"))
    }

    fn unknown_field(field: &str, known: &'static [&'static str]) -> Self {
        Self::custom(format!("unknown field `{field}`, expected one of {}", known.join(", ")))
    }

    fn unknown_variant(variant: &str, known: &'static [&'static str]) -> Self {
        Self::custom(format!("unknown variant `{variant}`, expected one of {}", known.join(", ")))
    }
}

impl Unfit {
    fn or_at(mut self, place: Place) -> Self {
        self.place.get_or_insert(place);
        self
    }
}

/// The name under which a value with its place asks a tree for both.
pub(super) const WITH_PLACE: &str = "canopen::source::At";

impl<'de> Deserializer<'de> for &'de Tree {
    type Error = Unfit;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Unfit> {
        let read = match &self.node {
            Node::Map(entries) => visitor.visit_map(Entries { entries, value: None }),
            Node::List(items) => visitor.visit_seq(Items(items)),
            Node::Int(number, _) => match (u64::try_from(*number), i64::try_from(*number)) {
                (Ok(number), _) => visitor.visit_u64(number),
                (_, Ok(number)) => visitor.visit_i64(number),
                _ => visitor.visit_i128(*number),
            },
            Node::Real(number, _) => visitor.visit_f64(*number),
            Node::Bool(on, _) => visitor.visit_bool(*on),
            Node::Text(text) => visitor.visit_borrowed_str(text),
            Node::Null => visitor.visit_unit(),
        };
        read.map_err(|unfit| unfit.or_at(self.place))
    }

    fn deserialize_str<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Unfit> {
        match self.text() {
            Some(text) => {
                visitor.visit_borrowed_str(text).map_err(|unfit: Unfit| unfit.or_at(self.place))
            }
            None => Err(<Unfit as de::Error>::custom("expected string scalar").or_at(self.place)),
        }
    }

    fn deserialize_string<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Unfit> {
        self.deserialize_str(visitor)
    }

    fn deserialize_identifier<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Unfit> {
        self.deserialize_str(visitor)
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Unfit> {
        match self.node {
            Node::Null => visitor.visit_none(),
            _ => visitor.visit_some(self),
        }
    }

    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Unfit> {
        match &self.node {
            Node::List(_) => self.deserialize_any(visitor),
            _ => Err(<Unfit as de::Error>::custom("expected sequence start").or_at(self.place)),
        }
    }

    fn deserialize_map<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Unfit> {
        match &self.node {
            Node::Map(_) => self.deserialize_any(visitor),
            _ => Err(<Unfit as de::Error>::custom("expected mapping start").or_at(self.place)),
        }
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Unfit> {
        self.deserialize_map(visitor)
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        name: &'static str,
        visitor: V,
    ) -> Result<V::Value, Unfit> {
        match name {
            WITH_PLACE => visitor.visit_seq(Placed { tree: self, part: 0 }),
            _ => visitor.visit_newtype_struct(self),
        }
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Unfit> {
        let read = match &self.node {
            Node::Map(entries) if entries.len() == 1 => {
                visitor.visit_enum(Variant { name: &entries[0].0, content: Some(&entries[0].1) })
            }
            Node::Map(entries) if entries.len() > 1 => {
                // The second key is the one that does not belong here.
                let (key, _) = &entries[1];
                let message =
                    format!("`{}` does not belong to `{}`", key.value, entries[0].0.value);
                Err(<Unfit as de::Error>::custom(message).or_at(key.place))
            }
            _ => match self.text() {
                Some(text) => {
                    let name = At::new(text.to_owned(), self.place);
                    visitor.visit_enum(Variant { name: &name, content: None })
                }
                None => Err(<Unfit as de::Error>::custom("expected mapping start")),
            },
        };
        read.map_err(|unfit| unfit.or_at(self.place))
    }

    serde::forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char bytes byte_buf unit unit_struct
        tuple tuple_struct ignored_any
    }
}

struct Entries<'de> {
    entries: &'de [(At<String>, Tree)],
    value: Option<&'de Tree>,
}

impl<'de> MapAccess<'de> for Entries<'de> {
    type Error = Unfit;

    fn next_key_seed<K: DeserializeSeed<'de>>(
        &mut self,
        seed: K,
    ) -> Result<Option<K::Value>, Unfit> {
        let Some(((key, value), rest)) = self.entries.split_first() else { return Ok(None) };
        (self.entries, self.value) = (rest, Some(value));
        seed.deserialize(Key(key)).map(Some).map_err(|unfit| unfit.or_at(key.place))
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(&mut self, seed: V) -> Result<V::Value, Unfit> {
        let tree = self.value.take().ok_or_else(|| de::Error::custom("a value has no key"))?;
        seed.deserialize(tree).map_err(|unfit| unfit.or_at(tree.place))
    }
}

/// A key, which may be asked for with its place, and for a number.
struct Key<'de>(&'de At<String>);

impl<'de> Deserializer<'de> for Key<'de> {
    type Error = Unfit;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Unfit> {
        match self.0.value.parse() {
            Ok(number) => visitor.visit_u64(number),
            Err(_) => visitor.visit_borrowed_str(&self.0.value),
        }
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        name: &'static str,
        visitor: V,
    ) -> Result<V::Value, Unfit> {
        match name {
            WITH_PLACE => visitor.visit_seq(PlacedKey { key: self.0, part: 0 }),
            _ => visitor.visit_newtype_struct(self),
        }
    }

    fn deserialize_str<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Unfit> {
        visitor.visit_borrowed_str(&self.0.value)
    }

    fn deserialize_string<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Unfit> {
        visitor.visit_borrowed_str(&self.0.value)
    }

    fn deserialize_identifier<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Unfit> {
        visitor.visit_borrowed_str(&self.0.value)
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        name: &'static str,
        variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Unfit> {
        BorrowedStrDeserializer::new(&self.0.value).deserialize_enum(name, variants, visitor)
    }

    serde::forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char bytes byte_buf option unit
        unit_struct seq tuple tuple_struct map struct ignored_any
    }
}

struct Items<'de>(&'de [Tree]);

impl<'de> SeqAccess<'de> for Items<'de> {
    type Error = Unfit;

    fn next_element_seed<T: DeserializeSeed<'de>>(
        &mut self,
        seed: T,
    ) -> Result<Option<T::Value>, Unfit> {
        let Some((item, rest)) = self.0.split_first() else { return Ok(None) };
        self.0 = rest;
        seed.deserialize(item).map(Some).map_err(|unfit| unfit.or_at(item.place))
    }

    fn size_hint(&self) -> Option<usize> {
        Some(self.0.len())
    }
}

/// Line, column and value.
struct Placed<'de> {
    tree: &'de Tree,
    part: u8,
}

impl<'de> SeqAccess<'de> for Placed<'de> {
    type Error = Unfit;

    fn next_element_seed<T: DeserializeSeed<'de>>(
        &mut self,
        seed: T,
    ) -> Result<Option<T::Value>, Unfit> {
        self.part += 1;
        let Place { line, column } = self.tree.place;
        match self.part {
            1 => seed.deserialize(line.into_deserializer()).map(Some),
            2 => seed.deserialize(column.into_deserializer()).map(Some),
            _ => seed.deserialize(self.tree).map(Some),
        }
    }
}

struct PlacedKey<'de> {
    key: &'de At<String>,
    part: u8,
}

impl<'de> SeqAccess<'de> for PlacedKey<'de> {
    type Error = Unfit;

    fn next_element_seed<T: DeserializeSeed<'de>>(
        &mut self,
        seed: T,
    ) -> Result<Option<T::Value>, Unfit> {
        self.part += 1;
        let Place { line, column } = self.key.place;
        match self.part {
            1 => seed.deserialize(line.into_deserializer()).map(Some),
            2 => seed.deserialize(column.into_deserializer()).map(Some),
            _ => seed.deserialize(Key(self.key)).map(Some),
        }
    }
}

struct Variant<'a, 'de> {
    name: &'a At<String>,
    content: Option<&'de Tree>,
}

impl<'de> EnumAccess<'de> for Variant<'_, 'de> {
    type Error = Unfit;
    type Variant = Content<'de>;

    fn variant_seed<V: DeserializeSeed<'de>>(
        self,
        seed: V,
    ) -> Result<(V::Value, Content<'de>), Unfit> {
        let name = StrDeserializer::<Unfit>::new(&self.name.value);
        let name = seed.deserialize(name).map_err(|unfit| unfit.or_at(self.name.place))?;
        Ok((name, Content(self.content)))
    }
}

struct Content<'de>(Option<&'de Tree>);

impl<'de> Content<'de> {
    fn tree(&self) -> Result<&'de Tree, Unfit> {
        self.0.ok_or_else(|| de::Error::custom("expected mapping start"))
    }
}

impl<'de> VariantAccess<'de> for Content<'de> {
    type Error = Unfit;

    fn unit_variant(self) -> Result<(), Unfit> {
        match self.0.map(|tree| (&tree.node, tree.place)) {
            None | Some((Node::Null, _)) => Ok(()),
            Some((_, place)) => {
                Err(<Unfit as de::Error>::custom("nothing belongs behind this word").or_at(place))
            }
        }
    }

    fn newtype_variant_seed<T: DeserializeSeed<'de>>(self, seed: T) -> Result<T::Value, Unfit> {
        let tree = self.tree()?;
        seed.deserialize(tree).map_err(|unfit| unfit.or_at(tree.place))
    }

    fn tuple_variant<V: Visitor<'de>>(self, _: usize, visitor: V) -> Result<V::Value, Unfit> {
        self.tree()?.deserialize_seq(visitor)
    }

    fn struct_variant<V: Visitor<'de>>(
        self,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Unfit> {
        self.tree()?.deserialize_map(visitor)
    }
}

/// A value with its place, from a tree or from the text.
impl<'de, T: Deserialize<'de>> Deserialize<'de> for At<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Either<T>(std::marker::PhantomData<T>);
        impl<'de, T: Deserialize<'de>> Visitor<'de> for Either<T> {
            type Value = At<T>;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a value with its place")
            }
            fn visit_seq<A: SeqAccess<'de>>(self, mut parts: A) -> Result<At<T>, A::Error> {
                let missing = || <A::Error as de::Error>::custom("a value has no place");
                let line = parts.next_element()?.ok_or_else(missing)?;
                let column = parts.next_element()?.ok_or_else(missing)?;
                let value = parts.next_element()?.ok_or_else(missing)?;
                Ok(At::new(value, Place::new(line, column)))
            }
            fn visit_newtype_struct<D: Deserializer<'de>>(
                self,
                deserializer: D,
            ) -> Result<At<T>, D::Error> {
                let spanned = serde_yaml::Spanned::<T>::deserialize(deserializer)?;
                let place = spanned.referenced;
                let place = Place::new(place.line() as usize, place.column() as usize);
                Ok(At::new(spanned.value, place))
            }
        }
        deserializer.deserialize_newtype_struct(WITH_PLACE, Either(std::marker::PhantomData))
    }
}

/// A scalar that is written so.
impl From<&str> for Node {
    fn from(text: &str) -> Self {
        scalar(Cow::Borrowed(text))
    }
}

/// The YAML meaning of a plain scalar, for numbers and truth values only.
fn scalar(text: Cow<'_, str>) -> Node {
    // Most scalars are words, for which a parser is slow. A shorter one may be `off`.
    let is_word = text.len() > 5
        && text.starts_with(|first: char| first == '$' || first.is_ascii_alphabetic());
    if is_word {
        return Node::Text(text.into_owned());
    }
    match serde_yaml::from_str::<Node>(&text) {
        Ok(Node::Int(number, _)) => Node::Int(number, text.into_owned()),
        Ok(Node::Real(number, _)) => Node::Real(number, text.into_owned()),
        Ok(Node::Bool(on, _)) => Node::Bool(on, text.into_owned()),
        _ => Node::Text(text.into_owned()),
    }
}
