//! A checkpoint's bytes: named tensors and texts in the safetensors format, under a checksum.

use std::collections::{BTreeMap, HashMap};

use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::de::DeserializeOwned;

use crate::bridge::{ExperienceState, GraphState};
use crate::train::graphs::StoredGraph;

/// What the metadata calls this kind of file. Format 1 had neither a checksum nor a history.
const FORMAT: &str = "gdg-tui checkpoint 2";
const FORMAT_BEFORE: &str = "gdg-tui checkpoint 1";

/// The checksum's place among the texts.
const CHECKSUM: &str = "checksum";

/// Tensors on their way to a file: name, type and bytes.
#[derive(Default)]
pub struct Tensors(BTreeMap<String, (Dtype, Vec<u8>)>);

impl Tensors {
    pub fn f32(&mut self, name: impl Into<String>, values: &[f32]) {
        self.0.insert(name.into(), (Dtype::F32, values.iter().flat_map(|v| v.to_le_bytes()).collect()));
    }

    pub fn u16(&mut self, name: &str, values: &[u16]) {
        self.0.insert(name.to_owned(), (Dtype::U16, values.iter().flat_map(|v| v.to_le_bytes()).collect()));
    }

    pub fn u32(&mut self, name: &str, values: &[u32]) {
        self.0.insert(name.to_owned(), (Dtype::U32, values.iter().flat_map(|v| v.to_le_bytes()).collect()));
    }

    pub fn u64(&mut self, name: &str, values: &[u64]) {
        self.0.insert(name.to_owned(), (Dtype::U64, values.iter().flat_map(|v| v.to_le_bytes()).collect()));
    }

    pub fn experience(&mut self, name: &str, state: &ExperienceState) {
        self.f32(format!("{name}.spacing"), &[state.spacing]);
        self.f32(format!("{name}.states"), &state.states);
        self.u16(&format!("{name}.observed"), &state.observed);
        self.u32(&format!("{name}.visits"), &state.visits);
        self.u32(&format!("{name}.names"), &state.names);
        self.u32(&format!("{name}.practice"), &state.practice);
    }

    pub fn graph(&mut self, name: &str, StoredGraph { at, due, state }: &StoredGraph) {
        self.u64(&format!("{name}.when"), &[*at, *due]);
        self.experience(name, &state.experience);
        self.u32(&format!("{name}.ends"), &state.ends);
        self.f32(format!("{name}.lengths"), &state.lengths);
    }

    /// The file's bytes, with `texts` as metadata and a checksum over all.
    ///
    /// # Errors
    /// What the format does not allow.
    pub fn into_bytes(self, texts: impl IntoIterator<Item = (impl Into<String>, String)>) -> Result<Vec<u8>, String> {
        let mut texts: BTreeMap<String, String> = texts.into_iter().map(|(name, text)| (name.into(), text)).collect();
        texts.insert("format".to_owned(), FORMAT.to_owned());
        let parts = self.0.iter().map(|(name, (dtype, bytes))| (name.as_str(), *dtype, bytes.as_slice()));
        let sum = checksum(texts.iter().map(|(name, text)| (name.as_str(), text.as_str())), parts);
        texts.insert(CHECKSUM.to_owned(), sum);
        let views = self.0.iter().map(|(name, (dtype, bytes))| {
            // Types of less than a byte are never ours.
            let size = (dtype.bitsize() / 8).max(1);
            TensorView::new(*dtype, vec![bytes.len() / size], bytes).map(|view| (name.as_str(), view))
        });
        let views = views.collect::<Result<Vec<_>, _>>().map_err(|e| e.to_string())?;
        safetensors::serialize(views, Some(texts.into_iter().collect())).map_err(|e| e.to_string())
    }
}

/// CRC-32 of texts and tensors, each in the order of their names: so that it does not depend on the order in a file.
fn checksum<'a>(
    texts: impl Iterator<Item = (&'a str, &'a str)>,
    tensors: impl Iterator<Item = (&'a str, Dtype, &'a [u8])>,
) -> String {
    let mut hasher = crc32fast::Hasher::new();
    // Lengths part names and contents from each other.
    let mut add = |bytes: &[u8]| {
        hasher.update(&(bytes.len() as u64).to_le_bytes());
        hasher.update(bytes);
    };
    for (name, text) in texts {
        add(name.as_bytes());
        add(text.as_bytes());
    }
    for (name, dtype, bytes) in tensors {
        add(name.as_bytes());
        add(format!("{dtype:?}").as_bytes());
        add(bytes);
    }
    format!("{:08x}", hasher.finalize())
}

/// The texts of a checkpoint.
pub struct Texts(HashMap<String, String>);

impl Texts {
    /// # Errors
    /// That they are not those of a checkpoint of this program.
    pub fn of(metadata: Option<HashMap<String, String>>) -> Result<Self, String> {
        let texts = Self(metadata.unwrap_or_default());
        match texts.get("format")? {
            FORMAT | FORMAT_BEFORE => Ok(texts),
            other => {
                let version = texts.get("version").unwrap_or("unknown");
                Err(format!("is of the format {other:?}, written by version {version}; this one reads {FORMAT:?}"))
            }
        }
    }

    /// # Errors
    /// That there is none of that name.
    pub fn get(&self, name: &str) -> Result<&str, String> {
        self.0.get(name).map(String::as_str).ok_or_else(|| format!("holds no {name}: it is not a checkpoint"))
    }

    /// The value whose JSON is the text called `name`.
    ///
    /// # Errors
    /// That there is none, or that it is another value's.
    pub fn json<T: DeserializeOwned>(&self, name: &str) -> Result<T, String> {
        serde_json::from_str(self.get(name)?).map_err(|e| format!("its {name} cannot be read: {e}"))
    }

    /// The history; format 1 had none.
    ///
    /// # Errors
    /// See [`Self::json`].
    pub fn history<T: DeserializeOwned + Default>(&self) -> Result<T, String> {
        if self.get("format")? == FORMAT_BEFORE { Ok(T::default()) } else { self.json("history") }
    }
}

/// A checkpoint read from bytes whose checksum is right.
pub struct Content<'a> {
    pub texts: Texts,
    tensors: SafeTensors<'a>,
}

impl<'a> Content<'a> {
    /// # Errors
    /// What is wrong with the bytes.
    pub fn read(bytes: &'a [u8]) -> Result<Self, String> {
        let not_ours = |e: safetensors::SafeTensorError| format!("is not a safetensors file: {e}");
        let (_, header) = SafeTensors::read_metadata(bytes).map_err(not_ours)?;
        let tensors = SafeTensors::deserialize(bytes).map_err(not_ours)?;
        let texts = Texts::of(header.metadata().clone())?;
        let content = Self { texts, tensors };
        if content.texts.get("format")? == FORMAT && content.texts.get(CHECKSUM)? != content.checksum() {
            return Err("is damaged: its checksum is not that of its contents".to_owned());
        }
        Ok(content)
    }

    fn checksum(&self) -> String {
        let texts: BTreeMap<_, _> = self.texts.0.iter().filter(|(name, _)| *name != CHECKSUM).collect();
        let tensors: BTreeMap<_, _> = self.tensors.iter().collect();
        checksum(
            texts.into_iter().map(|(name, text)| (name.as_str(), text.as_str())),
            tensors.iter().map(|(name, view)| (*name, view.dtype(), view.data())),
        )
    }

    pub fn f32(&self, name: &str) -> Result<Vec<f32>, String> {
        self.numbers(name, Dtype::F32, f32::from_le_bytes)
    }

    pub fn u16(&self, name: &str) -> Result<Vec<u16>, String> {
        self.numbers(name, Dtype::U16, u16::from_le_bytes)
    }

    pub fn u32(&self, name: &str) -> Result<Vec<u32>, String> {
        self.numbers(name, Dtype::U32, u32::from_le_bytes)
    }

    pub fn u64(&self, name: &str) -> Result<Vec<u64>, String> {
        self.numbers(name, Dtype::U64, u64::from_le_bytes)
    }

    pub fn experience(&self, name: &str) -> Result<ExperienceState, String> {
        Ok(ExperienceState {
            spacing: self.f32(&format!("{name}.spacing"))?.first().copied().unwrap_or_default(),
            states: self.f32(&format!("{name}.states"))?,
            observed: self.u16(&format!("{name}.observed"))?,
            visits: self.u32(&format!("{name}.visits"))?,
            names: self.u32(&format!("{name}.names"))?,
            practice: self.u32(&format!("{name}.practice"))?,
        })
    }

    /// The bridge graph saved under `name`, if there is one.
    pub fn graph(&self, name: &str) -> Result<Option<StoredGraph>, String> {
        let when = format!("{name}.when");
        if !self.tensors.names().iter().any(|known| **known == when) {
            return Ok(None);
        }
        let [at, due] = self.u64(&when)?[..] else { return Err(format!("its {when} is of another length than 2")) };
        let (ends, lengths) = (self.u32(&format!("{name}.ends"))?, self.f32(&format!("{name}.lengths"))?);
        Ok(Some(StoredGraph { at, due, state: GraphState { experience: self.experience(name)?, ends, lengths } }))
    }

    fn numbers<T, const N: usize>(&self, name: &str, dtype: Dtype, parse: fn([u8; N]) -> T) -> Result<Vec<T>, String> {
        let view = self.tensors.tensor(name).map_err(|_| format!("holds no {name}"))?;
        if view.dtype() != dtype {
            return Err(format!("its {name} is of another type than {dtype:?}"));
        }
        let (numbers, _) = view.data().as_chunks::<N>();
        Ok(numbers.iter().map(|bytes| parse(*bytes)).collect())
    }
}

/// The same checkpoint with a checksum that is right: for tests of what comes behind it. `None` where it is none.
pub fn resealed(bytes: &[u8]) -> Option<Vec<u8>> {
    let (_, header) = SafeTensors::read_metadata(bytes).ok()?;
    let read = SafeTensors::deserialize(bytes).ok()?;
    let texts = header.metadata().clone()?;
    let tensors = read.iter().map(|(name, view)| (name.to_owned(), (view.dtype(), view.data().to_vec())));
    let kept = texts.into_iter().filter(|(name, _)| name != CHECKSUM && name != "format");
    Tensors(tensors.collect()).into_bytes(kept).ok()
}
