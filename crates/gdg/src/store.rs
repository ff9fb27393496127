//! Named arrays and texts: the form in which all persistent state is saved.
//!
//! Worlds, learners, the replay and the bridge candidates save themselves to a [`Store`] and load
//! themselves from one; only the checkpoint module knows how a store is written to a file.

use std::collections::BTreeMap;

use serde::Serialize;
use serde::de::DeserializeOwned;

/// An array of numbers of one type.
#[derive(Clone, Debug, PartialEq)]
pub enum Array {
    /// Single precision.
    F32(Vec<f32>),
    /// 16-bit counts.
    U16(Vec<u16>),
    /// 32-bit counts.
    U32(Vec<u32>),
    /// 64-bit counts.
    U64(Vec<u64>),
}

impl Array {
    /// Returns the number of numbers.
    pub fn len(&self) -> usize {
        match self {
            Self::F32(numbers) => numbers.len(),
            Self::U16(numbers) => numbers.len(),
            Self::U32(numbers) => numbers.len(),
            Self::U64(numbers) => numbers.len(),
        }
    }

    /// Returns whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Arrays and texts by name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Store {
    arrays: BTreeMap<String, Array>,
    texts: BTreeMap<String, String>,
}

/// An error in a store's contents.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum StoreError {
    /// An array or text is missing.
    #[error("has no {0}: it is not a checkpoint")]
    Missing(String),
    /// An array has the wrong type.
    #[error("its {name} is not of type {expected}")]
    Type {
        /// Name of the array.
        name: String,
        /// The expected type.
        expected: &'static str,
    },
    /// A text cannot be parsed as the expected value.
    #[error("its {name} cannot be read: {why}")]
    Unreadable {
        /// Name of the text.
        name: String,
        /// The parser's message.
        why: String,
    },
    /// Contents contradict each other or the settings, or are out of range.
    #[error("{0}")]
    Inconsistent(String),
}

impl StoreError {
    /// Creates an error about contents that do not fit.
    pub fn inconsistent(message: impl Into<String>) -> Self {
        Self::Inconsistent(message.into())
    }
}

/// Maps each number type to its variant.
macro_rules! array_types {
    ($($variant:ident $number:ident),*) => {
        $(impl From<Vec<$number>> for Array {
            fn from(numbers: Vec<$number>) -> Self {
                Self::$variant(numbers)
            }
        }

        impl Store {
            #[doc = concat!("Returns the array `name` of `", stringify!($number), "` numbers.")]
            ///
            /// # Errors
            /// Fails if it is missing or has another type.
            pub fn $number(&self, name: &str) -> Result<&[$number], StoreError> {
                match self.array(name)? {
                    Array::$variant(numbers) => Ok(numbers),
                    _ => Err(StoreError::Type { name: name.to_owned(), expected: stringify!($variant) }),
                }
            }
        })*
    };
}

array_types!(F32 f32, U16 u16, U32 u32, U64 u64);

impl Store {
    /// Adds an array, replacing one of the same name.
    pub fn put(&mut self, name: impl Into<String>, numbers: impl Into<Array>) {
        self.arrays.insert(name.into(), numbers.into());
    }

    /// Adds a text, replacing one of the same name.
    pub fn put_text(&mut self, name: impl Into<String>, text: impl Into<String>) {
        self.texts.insert(name.into(), text.into());
    }

    /// Adds a value as JSON.
    ///
    /// # Errors
    /// Returns [`StoreError::Unreadable`] for a value that JSON cannot express.
    pub fn put_json(&mut self, name: &str, value: &impl Serialize) -> Result<(), StoreError> {
        let text = serde_json::to_string(value);
        self.put_text(
            name,
            text.map_err(|e| StoreError::Unreadable { name: name.to_owned(), why: e.to_string() })?,
        );
        Ok(())
    }

    /// Returns all arrays and texts, by name.
    pub fn into_parts(self) -> (BTreeMap<String, Array>, BTreeMap<String, String>) {
        (self.arrays, self.texts)
    }

    /// Returns all arrays, by name.
    pub fn arrays(&self) -> &BTreeMap<String, Array> {
        &self.arrays
    }

    /// Returns all texts, by name.
    pub fn texts(&self) -> &BTreeMap<String, String> {
        &self.texts
    }

    /// Returns whether every floating-point number is finite.
    pub fn is_finite(&self) -> bool {
        let finite = |array: &Array| match array {
            Array::F32(numbers) => numbers.iter().all(|v| v.is_finite()),
            _ => true,
        };
        self.arrays.values().all(finite)
    }

    /// Returns whether there is an array of this name.
    pub fn has(&self, name: &str) -> bool {
        self.arrays.contains_key(name)
    }

    fn array(&self, name: &str) -> Result<&Array, StoreError> {
        self.arrays.get(name).ok_or_else(|| StoreError::Missing(name.to_owned()))
    }

    /// Returns the text called `name`.
    ///
    /// # Errors
    /// Fails if it is missing.
    pub fn text(&self, name: &str) -> Result<&str, StoreError> {
        self.texts.get(name).map(String::as_str).ok_or_else(|| StoreError::Missing(name.to_owned()))
    }

    /// Parses the text called `name` as JSON.
    ///
    /// # Errors
    /// Fails if it is missing or does not represent a `T`.
    pub fn json<T: DeserializeOwned>(&self, name: &str) -> Result<T, StoreError> {
        let unreadable = |e: serde_json::Error| StoreError::Unreadable {
            name: name.to_owned(),
            why: e.to_string(),
        };
        serde_json::from_str(self.text(name)?).map_err(unreadable)
    }
}

/// Maps differences that are small, of either sign, to small numbers: 0, -1, 1, -2 ... to
/// 0, 1, 2, 3 ...
pub fn zigzag(difference: i64) -> u64 {
    (difference << 1 ^ difference >> 63).cast_unsigned()
}

/// Reverses [`zigzag`].
pub fn from_zigzag(number: u64) -> i64 {
    (number >> 1).cast_signed() ^ -(number & 1).cast_signed()
}
