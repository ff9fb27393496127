//! Named numbers and values: the form in which all persistent state is saved.
//!
//! Worlds, learners and the trainer save themselves to a [`Store`] and load themselves from one;
//! only the checkpoint module knows how a store becomes a file.

use std::collections::BTreeMap;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Ending of the name of a running average, which is close to the numbers without it.
const AVERAGE: &str = "_average";

/// Arrays of numbers, and values of any type in postcard's form, by name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Store {
    numbers: BTreeMap<String, Vec<f32>>,
    values: BTreeMap<String, Vec<u8>>,
}

/// What is wrong with a store's contents: they are missing, of another type, contradict each other or
/// the settings, or are out of range.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct StoreError(String);

impl StoreError {
    pub fn inconsistent(message: impl Into<String>) -> Self {
        Self(message.into())
    }

    /// Returns an error with this message unless contents are as they should be.
    pub fn unless(holds: bool, message: &str) -> Result<(), Self> {
        if holds { Ok(()) } else { Err(Self::inconsistent(message)) }
    }

    pub(crate) fn missing(name: &str) -> Self {
        Self(format!("has no {name}: it is not a checkpoint"))
    }

    pub(crate) fn unreadable(name: &str, why: impl std::fmt::Display) -> Self {
        Self(format!("its {name} cannot be read: {why}"))
    }
}

impl Store {
    /// Adds numbers, replacing those of the same name.
    pub fn put_numbers(&mut self, name: impl Into<String>, numbers: Vec<f32>) {
        self.numbers.insert(name.into(), numbers);
    }

    pub fn numbers(&self, name: &str) -> Result<&[f32], StoreError> {
        self.numbers.get(name).map(Vec::as_slice).ok_or_else(|| StoreError::missing(name))
    }

    pub fn put(&mut self, name: &str, value: &impl Serialize) -> Result<(), StoreError> {
        let bytes = to_bytes(value).map_err(|e| StoreError::unreadable(name, e))?;
        self.values.insert(name.to_owned(), bytes);
        Ok(())
    }

    pub fn get<T: DeserializeOwned>(&self, name: &str) -> Result<T, StoreError> {
        let (value, rest) = postcard::take_from_bytes(self.bytes(name)?)
            .map_err(|e| StoreError::unreadable(name, e))?;
        if rest.is_empty() {
            Ok(value)
        } else {
            Err(StoreError::unreadable(name, "something follows it"))
        }
    }

    pub fn put_text(&mut self, name: &str, text: impl Into<String>) {
        self.values.insert(name.to_owned(), text.into().into_bytes());
    }

    pub fn text(&self, name: &str) -> Result<&str, StoreError> {
        str::from_utf8(self.bytes(name)?).map_err(|e| StoreError::unreadable(name, e))
    }

    /// Adds a value as JSON, for types that postcard does not know.
    pub fn put_json(&mut self, name: &str, value: &impl Serialize) -> Result<(), StoreError> {
        let text = serde_json::to_string(value).map_err(|e| StoreError::unreadable(name, e))?;
        self.put_text(name, text);
        Ok(())
    }

    pub fn json<T: DeserializeOwned>(&self, name: &str) -> Result<T, StoreError> {
        serde_json::from_str(self.text(name)?).map_err(|e| StoreError::unreadable(name, e))
    }

    fn bytes(&self, name: &str) -> Result<&[u8], StoreError> {
        self.values.get(name).map(Vec::as_slice).ok_or_else(|| StoreError::missing(name))
    }

    pub fn is_finite(&self) -> bool {
        self.numbers.values().flatten().all(|number| number.is_finite())
    }

    /// Returns everything as bytes by name, for comparing states bit by bit.
    pub fn parts(&self) -> BTreeMap<String, Vec<u8>> {
        let bits =
            |numbers: &Vec<f32>| numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
        let numbers = self.numbers.iter().map(|(name, numbers)| (name.clone(), bits(numbers)));
        numbers.chain(self.values.clone()).collect()
    }
}

/// The planes of numbers, averages as what remains without the numbers that they are close to.
impl Serialize for Store {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let numbers: BTreeMap<_, _> = self
            .numbers
            .iter()
            .map(|(name, own)| {
                let near = averaged(name, own.len(), &self.numbers);
                (name, Bytes(planes::of(own, near)))
            })
            .collect();
        let values: BTreeMap<_, _> =
            self.values.iter().map(|(name, value)| (name, Bytes(value))).collect();
        (numbers, values).serialize(to)
    }
}

impl<'de> Deserialize<'de> for Store {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        type Parts<'a> = BTreeMap<String, Bytes<&'a [u8]>>;
        let (numbers, values) = <(Parts<'de>, Parts<'de>)>::deserialize(from)?;
        let mut store = Self::default();
        for (name, Bytes(bytes)) in numbers {
            // A name without this ending comes earlier.
            let near = averaged(&name, bytes.len() / 4, &store.numbers);
            let own = planes::numbers(bytes, near);
            store.numbers.insert(name, own);
        }
        store.values =
            values.into_iter().map(|(name, Bytes(value))| (name, value.to_vec())).collect();
        Ok(store)
    }
}

/// Returns the numbers that the `count` ones called `name` are the running average of.
fn averaged<'a>(
    name: &str,
    count: usize,
    all: &'a BTreeMap<String, Vec<f32>>,
) -> Option<&'a [f32]> {
    let of = all.get(name.strip_suffix(AVERAGE)?)?;
    (of.len() == count).then_some(of)
}

/// Bytes that are written at once, not one by one.
struct Bytes<T>(T);

impl<T: AsRef<[u8]>> Serialize for Bytes<T> {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_bytes(self.0.as_ref())
    }
}

impl<'de> Deserialize<'de> for Bytes<&'de [u8]> {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        <&[u8]>::deserialize(from).map(Bytes)
    }
}

/// Floats by planes: the lowest bytes of all of them, then the next higher ones, and so on. Most
/// bits of a float are random, but its exponent is not: its plane can be packed.
pub(crate) mod planes {
    use serde::{Deserialize, Deserializer, Serializer};

    use super::{Bytes, from_zigzag, zigzag};

    pub fn serialize<S: Serializer>(numbers: &[f32], to: S) -> Result<S::Ok, S::Error> {
        to.serialize_bytes(&of(numbers, None))
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<f32>, D::Error> {
        Bytes::deserialize(from).map(|Bytes(bytes)| numbers(bytes, None))
    }

    /// Returns the planes of `numbers`, or of their differences to `near`, of the same length.
    pub(super) fn of(numbers: &[f32], near: Option<&[f32]>) -> Vec<u8> {
        let mut planes = vec![0; 4 * numbers.len()];
        for (i, number) in numbers.iter().enumerate() {
            let bits = match near {
                Some(near) => zigzag(number.to_bits().wrapping_sub(near[i].to_bits())),
                // The exponent becomes one byte, the sign the lowest bit.
                None => number.to_bits().rotate_left(1),
            };
            for (plane, byte) in bits.to_le_bytes().into_iter().enumerate() {
                planes[plane * numbers.len() + i] = byte;
            }
        }
        planes
    }

    pub(super) fn numbers(planes: &[u8], near: Option<&[f32]>) -> Vec<f32> {
        let count = planes.len() / 4;
        let number = |i: usize| {
            let bits = u32::from_le_bytes([0, 1, 2, 3].map(|plane| planes[plane * count + i]));
            f32::from_bits(match near {
                Some(near) => near[i].to_bits().wrapping_add(from_zigzag(bits)),
                None => bits.rotate_right(1),
            })
        };
        (0..count).map(number).collect()
    }
}

pub(crate) fn to_bytes(value: &impl Serialize) -> postcard::Result<Vec<u8>> {
    postcard::to_extend(value, Vec::new())
}

/// Maps differences that are small, of either sign, to small numbers: 0, -1, 1, -2 ... to
/// 0, 1, 2, 3 ...
pub(crate) fn zigzag(difference: u32) -> u32 {
    difference << 1 ^ (difference.cast_signed() >> 31).cast_unsigned()
}

pub(crate) fn from_zigzag(number: u32) -> u32 {
    number >> 1 ^ (number & 1).wrapping_neg()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn numbers_and_their_averages_are_restored_bit_by_bit(
            pairs in prop::collection::vec((any::<u32>(), any::<u32>()), 0..40),
        ) {
            let (own, average): (Vec<f32>, Vec<f32>) = pairs
                .iter()
                .map(|(own, average)| (f32::from_bits(*own), f32::from_bits(*average)))
                .unzip();
            let mut store = Store::default();
            store.put_numbers("a", own);
            store.put_numbers("a_average", average.clone());
            // Of other lengths, or of nothing.
            store.put_numbers("b", vec![1.0; 41]);
            store.put_numbers("b_average", average.clone());
            store.put_numbers("c_average", average);
            store.put("some", &(7_u8, "text")).expect("postcard knows these");
            let bytes = to_bytes(&store).expect("so is a store");
            let again: Store = postcard::from_bytes(&bytes).expect("its own bytes");
            prop_assert_eq!(again.parts(), store.parts());
        }
    }

    #[test]
    fn values_of_another_type_are_refused_with_their_name() {
        let mut store = Store::default();
        store.put("some", &(7_u8, "text")).expect("postcard knows these");
        assert_eq!(store.get("some"), Ok((7_u8, "text".to_owned())));
        for error in [
            store.get::<u8>("some").expect_err("something follows it"),
            store.get::<(String, String)>("some").expect_err("too short"),
            store.json::<u8>("some").expect_err("not JSON"),
        ] {
            assert!(error.to_string().starts_with("its some cannot be read: "), "{error}");
        }
        assert_eq!(store.get::<u8>("other"), Err(StoreError::missing("other")));
    }
}
