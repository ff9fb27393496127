//! Named arrays of numbers and texts: what everything that outlives the program is saved as.
//!
//! Worlds, learners, the replay and the bridge candidates write themselves to a [`Store`] and read themselves from
//! one; only the checkpoint knows how a store becomes a file.

use std::collections::BTreeMap;

use serde::Serialize;
use serde::de::DeserializeOwned;

/// Numbers of one type.
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

/// Arrays and texts by name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Store {
    arrays: BTreeMap<String, Array>,
    texts: BTreeMap<String, String>,
}

/// What is wrong with a store's contents.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum StoreError {
    /// An array or text that is not there.
    #[error("holds no {0}: it is not a checkpoint")]
    Missing(String),
    /// An array of another type.
    #[error("its {name} is of another type than {expected}")]
    Type {
        /// The array.
        name: String,
        /// The type that it should have.
        expected: &'static str,
    },
    /// A text that is not the expected value.
    #[error("its {name} cannot be read: {why}")]
    Unreadable {
        /// The text.
        name: String,
        /// What the parser says.
        why: String,
    },
    /// Contents that contradict each other, the settings, or the range of their values.
    #[error("{0}")]
    Misfit(String),
}

impl StoreError {
    /// An error about contents that do not fit.
    pub fn misfit(what: impl Into<String>) -> Self {
        Self::Misfit(what.into())
    }
}

macro_rules! array_types {
    ($($variant:ident $number:ty),*) => {
        $(impl From<Vec<$number>> for Array {
            fn from(numbers: Vec<$number>) -> Self {
                Self::$variant(numbers)
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
    /// [`StoreError::Unreadable`] for a value that JSON cannot express.
    pub fn put_json(&mut self, name: &str, value: &impl Serialize) -> Result<(), StoreError> {
        let text = serde_json::to_string(value);
        self.put_text(name, text.map_err(|e| StoreError::Unreadable { name: name.to_owned(), why: e.to_string() })?);
        Ok(())
    }

    /// All arrays and texts, by name.
    pub fn into_parts(self) -> (BTreeMap<String, Array>, BTreeMap<String, String>) {
        (self.arrays, self.texts)
    }

    /// All arrays, by name.
    pub fn arrays(&self) -> &BTreeMap<String, Array> {
        &self.arrays
    }

    /// All texts, by name.
    pub fn texts(&self) -> &BTreeMap<String, String> {
        &self.texts
    }

    /// Whether every floating-point number is finite.
    pub fn is_finite(&self) -> bool {
        let finite = |array: &Array| match array {
            Array::F32(numbers) => numbers.iter().all(|v| v.is_finite()),
            _ => true,
        };
        self.arrays.values().all(finite)
    }

    /// Whether there is an array of this name.
    pub fn has(&self, name: &str) -> bool {
        self.arrays.contains_key(name)
    }

    fn array(&self, name: &str) -> Result<&Array, StoreError> {
        self.arrays.get(name).ok_or_else(|| StoreError::Missing(name.to_owned()))
    }

    /// The array `name` of single-precision numbers.
    ///
    /// # Errors
    /// That it is missing or of another type.
    pub fn f32(&self, name: &str) -> Result<&[f32], StoreError> {
        match self.array(name)? {
            Array::F32(numbers) => Ok(numbers),
            _ => Err(StoreError::Type { name: name.to_owned(), expected: "F32" }),
        }
    }

    /// The array `name` of 16-bit counts.
    ///
    /// # Errors
    /// That it is missing or of another type.
    pub fn u16(&self, name: &str) -> Result<&[u16], StoreError> {
        match self.array(name)? {
            Array::U16(numbers) => Ok(numbers),
            _ => Err(StoreError::Type { name: name.to_owned(), expected: "U16" }),
        }
    }

    /// The array `name` of 32-bit counts.
    ///
    /// # Errors
    /// That it is missing or of another type.
    pub fn u32(&self, name: &str) -> Result<&[u32], StoreError> {
        match self.array(name)? {
            Array::U32(numbers) => Ok(numbers),
            _ => Err(StoreError::Type { name: name.to_owned(), expected: "U32" }),
        }
    }

    /// The array `name` of 64-bit counts.
    ///
    /// # Errors
    /// That it is missing or of another type.
    pub fn u64(&self, name: &str) -> Result<&[u64], StoreError> {
        match self.array(name)? {
            Array::U64(numbers) => Ok(numbers),
            _ => Err(StoreError::Type { name: name.to_owned(), expected: "U64" }),
        }
    }

    /// The text called `name`.
    ///
    /// # Errors
    /// That it is missing.
    pub fn text(&self, name: &str) -> Result<&str, StoreError> {
        self.texts.get(name).map(String::as_str).ok_or_else(|| StoreError::Missing(name.to_owned()))
    }

    /// The value whose JSON is the text called `name`.
    ///
    /// # Errors
    /// That it is missing or another value's.
    pub fn json<T: DeserializeOwned>(&self, name: &str) -> Result<T, StoreError> {
        let unreadable = |e: serde_json::Error| StoreError::Unreadable { name: name.to_owned(), why: e.to_string() };
        serde_json::from_str(self.text(name)?).map_err(unreadable)
    }
}
