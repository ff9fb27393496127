//! Arrays in a checkpoint without redundancy: exact, and about half as large.
//!
//! Most bits of a weight are random, but its exponent is not; and an average is close to its
//! weight, a sorted index to the one before, a frozen copy equal to its original. So an array is
//! packed as what remains of each number without a prediction; the lowest bytes of all numbers come
//! first, then the next higher ones and so on, each of these planes deflated if that shortens it.

use std::collections::{BTreeMap, HashMap};
use std::io::{Read, Write};

use flate2::Compression;
use flate2::read::DeflateDecoder;
use flate2::write::DeflateEncoder;
use serde::{Deserialize, Serialize};

use crate::store::{Array, from_zigzag, zigzag};

/// Arrays with fewer bytes stay as they are.
const MIN_BYTES: usize = 2_048;

/// Packed arrays have at most this share of the bytes.
const MAX_SHARE: f64 = 0.95;

/// Number and size of the samples that tell whether a plane can be deflated at all.
const SAMPLES: usize = 16;
const SAMPLE_BYTES: usize = 1_024;

/// Ending of the name of a running average, which is close to the array without it.
const AVERAGE: &str = "_average";

/// How an array is packed, in the metadata.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Packing {
    #[serde(rename = "type")]
    number: Number,
    /// Length of the array.
    count: u64,
    prediction: Prediction,
}

/// A packed array cannot be unpacked.
#[derive(Debug, thiserror::Error)]
#[error("is damaged: its {name} cannot be unpacked: {problem}")]
pub struct PackedError {
    /// Name of the array.
    name: String,
    /// What is wrong with it.
    problem: &'static str,
}

/// Type of an array's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Number {
    F32,
    U16,
    U32,
    U64,
}

/// What each number is stored as the difference to; differences are those of the bits.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Prediction {
    /// Nothing. The bits are rotated so that a float's exponent is one byte.
    None,
    /// The number before.
    Previous,
    /// The same place in another array of the same type and length, whose name comes earlier.
    Array(String),
}

impl Number {
    fn of(array: &Array) -> Self {
        match array {
            Array::F32(_) => Self::F32,
            Array::U16(_) => Self::U16,
            Array::U32(_) => Self::U32,
            Array::U64(_) => Self::U64,
        }
    }

    fn bytes(self) -> usize {
        match self {
            Self::U16 => 2,
            Self::F32 | Self::U32 => 4,
            Self::U64 => 8,
        }
    }

    /// Returns the array of numbers with these bits.
    fn array(self, bits: &[u64]) -> Array {
        let bits = bits.iter();
        match self {
            Self::F32 => bits.map(|bits| f32::from_bits(*bits as u32)).collect::<Vec<_>>().into(),
            Self::U16 => bits.map(|bits| *bits as u16).collect::<Vec<_>>().into(),
            Self::U32 => bits.map(|bits| *bits as u32).collect::<Vec<_>>().into(),
            Self::U64 => bits.copied().collect::<Vec<_>>().into(),
        }
    }

    /// Rotates bits by one to the left, which moves a float's sign from the top to the bottom.
    fn rotated(self, bits: u64) -> u64 {
        self.cut(bits << 1) | bits >> (8 * self.bytes() - 1)
    }

    fn rotated_back(self, bits: u64) -> u64 {
        bits >> 1 | self.cut(bits << (8 * self.bytes() - 1))
    }

    /// Returns `bits - from`, wrapping, with the sign at the bottom: small for either sign.
    fn difference(self, bits: u64, from: u64) -> u64 {
        let unused = 64 - 8 * self.bytes();
        let difference = (bits.wrapping_sub(from) << unused).cast_signed() >> unused;
        self.cut(zigzag(difference))
    }

    fn sum(self, from: u64, difference: u64) -> u64 {
        self.cut(from.wrapping_add_signed(from_zigzag(difference)))
    }

    /// Removes the bits above those of a number.
    fn cut(self, bits: u64) -> u64 {
        bits & u64::MAX >> (64 - 8 * self.bytes())
    }
}

impl Packing {
    /// Returns the array's size in memory in bytes; the largest number if there is none.
    pub fn unpacked_bytes(&self) -> u64 {
        self.count.saturating_mul(self.number.bytes() as u64)
    }

    /// Unpacks the array `name` from `bytes`, given those with earlier names.
    ///
    /// # Errors
    /// The bytes are not an array packed like this.
    pub fn unpack(
        &self,
        name: &str,
        bytes: &[u8],
        earlier: &BTreeMap<String, Array>,
    ) -> Result<Array, PackedError> {
        let failed = |problem| PackedError { name: name.to_owned(), problem };
        let (number, width) = (self.number, self.number.bytes());
        let count = usize::try_from(self.count).map_err(|_| failed("it is too long"))?;
        let (ends, mut rest) =
            bytes.split_at_checked(8 * width).ok_or_else(|| failed("it is cut off"))?;
        let mut bits = Vec::new();
        for (i, length) in ends.as_chunks::<8>().0.iter().enumerate() {
            let length = usize::try_from(u64::from_le_bytes(*length)).ok();
            let (own, after) = length
                .and_then(|length| rest.split_at_checked(length))
                .ok_or_else(|| failed("it is cut off"))?;
            rest = after;
            let plane = inflated(own, count).ok_or_else(|| failed("its length is wrong"))?;
            bits.resize(count, 0);
            bits.iter_mut().zip(plane).for_each(|(b, byte)| *b |= u64::from(byte) << (8 * i));
        }
        if !rest.is_empty() {
            return Err(failed("something follows it"));
        }
        match &self.prediction {
            Prediction::None => bits.iter_mut().for_each(|b| *b = number.rotated_back(*b)),
            Prediction::Previous => {
                let mut previous = 0;
                for b in &mut bits {
                    *b = number.sum(previous, *b);
                    previous = *b;
                }
            }
            Prediction::Array(of) => {
                let from = earlier.get(of).filter(|from| Number::of(from) == number).map(bits_of);
                let from = from
                    .filter(|from| from.len() == count)
                    .ok_or_else(|| failed("the array that it is similar to is missing"))?;
                bits.iter_mut().zip(from).for_each(|(b, from)| *b = number.sum(from, *b));
            }
        }
        Ok(number.array(&bits))
    }
}

/// Packs arrays one after the other, in order of name.
#[derive(Default)]
pub struct Packer {
    /// Arrays by type and bits, to find equal ones.
    seen: HashMap<(usize, u32), String>,
}

impl Packer {
    /// Packs the array `name` of `arrays`; `None` if that hardly shortens it.
    pub fn pack(
        &mut self,
        name: &str,
        arrays: &BTreeMap<String, Array>,
    ) -> Option<(Packing, Vec<u8>)> {
        let array = &arrays[name];
        let (number, bits) = (Number::of(array), bits_of(array));
        let bytes = bits.len() * number.bytes();
        if bytes < MIN_BYTES {
            return None;
        }
        let prediction = self.prediction(name, number, &bits, arrays);
        let rest: Vec<u64> = match &prediction {
            Prediction::None => bits.iter().map(|b| number.rotated(*b)).collect(),
            Prediction::Previous => differences(number, &bits).collect(),
            Prediction::Array(of) => {
                let from = bits_of(&arrays[of]);
                bits.iter().zip(from).map(|(b, from)| number.difference(*b, from)).collect()
            }
        };
        let planes = (0..number.bytes())
            .map(|i| deflated(rest.iter().map(|rest| (rest >> (8 * i)) as u8).collect()));
        let planes: Vec<Vec<u8>> = planes.collect();
        let mut packed = Vec::new();
        planes.iter().for_each(|plane| packed.extend((plane.len() as u64).to_le_bytes()));
        planes.iter().for_each(|plane| packed.extend(plane));
        let packing = Packing { number, count: bits.len() as u64, prediction };
        (packed.len() as f64 <= MAX_SHARE * bytes as f64).then_some((packing, packed))
    }

    /// Chooses the prediction that leaves least of an array.
    fn prediction(
        &mut self,
        name: &str,
        number: Number,
        bits: &[u64],
        arrays: &BTreeMap<String, Array>,
    ) -> Prediction {
        let alike = |other: &str| {
            let other = arrays.get(other);
            other.is_some_and(|other| Number::of(other) == number && other.len() == bits.len())
        };
        let mut sum = crc32fast::Hasher::new();
        bits.iter().for_each(|b| sum.update(&b.to_le_bytes()));
        let equal =
            self.seen.entry((bits.len(), sum.finalize())).or_insert_with(|| name.to_owned());
        if equal != name && alike(equal) {
            return Prediction::Array(equal.clone());
        }
        if let Some(of) = name.strip_suffix(AVERAGE).filter(|of| alike(of)) {
            return Prediction::Array(of.to_owned());
        }
        if number == Number::F32 {
            return Prediction::None;
        }
        // The bytes that a number takes once its highest bit is the lowest one.
        let used = |bits: u64| u64::from((71 - (bits << 1).leading_zeros()) / 8);
        let without: u64 = bits.iter().map(|b| used(*b)).sum();
        let with: u64 = differences(number, bits).map(used).sum();
        if with < without { Prediction::Previous } else { Prediction::None }
    }
}

/// Returns each number's difference to the one before.
fn differences(number: Number, bits: &[u64]) -> impl Iterator<Item = u64> {
    let before = std::iter::once(0).chain(bits.iter().copied());
    bits.iter().zip(before).map(move |(b, before)| number.difference(*b, before))
}

fn bits_of(array: &Array) -> Vec<u64> {
    match array {
        Array::F32(numbers) => numbers.iter().map(|number| u64::from(number.to_bits())).collect(),
        Array::U16(numbers) => numbers.iter().copied().map(u64::from).collect(),
        Array::U32(numbers) => numbers.iter().copied().map(u64::from).collect(),
        Array::U64(numbers) => numbers.clone(),
    }
}

/// Returns a plane deflated, or as it is if that does not shorten it.
fn deflated(plane: Vec<u8>) -> Vec<u8> {
    let deflate = |bytes: &[u8]| {
        let mut encoder = DeflateEncoder::new(Vec::new(), Compression::fast());
        encoder.write_all(bytes).and_then(|()| encoder.finish()).unwrap_or_default()
    };
    // Random bytes take longest to deflate: most planes of weights.
    if plane.len() > 4 * SAMPLES * SAMPLE_BYTES {
        let every = plane.len() / SAMPLES;
        let sample: Vec<u8> = plane
            .chunks(every)
            .flat_map(|part| &part[..SAMPLE_BYTES.min(part.len())])
            .copied()
            .collect();
        if deflate(&sample).len() as f64 > MAX_SHARE * sample.len() as f64 {
            return plane;
        }
    }
    let short = deflate(&plane);
    if (1..plane.len()).contains(&short.len()) { short } else { plane }
}

/// Returns the `count` bytes of a plane; `None` if it has another number.
fn inflated(bytes: &[u8], count: usize) -> Option<Vec<u8>> {
    if bytes.len() == count {
        return Some(bytes.to_vec());
    }
    let mut plane = Vec::new();
    // Never more than expected, whatever the file says.
    DeflateDecoder::new(bytes)
        .take((count as u64).saturating_add(1))
        .read_to_end(&mut plane)
        .ok()?;
    (plane.len() == count).then_some(plane)
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// Packs and unpacks `arrays`; returns the packed bytes of each.
    fn packed(arrays: &BTreeMap<String, Array>) -> BTreeMap<String, (Packing, Vec<u8>)> {
        let (mut packer, mut all, mut again) =
            (Packer::default(), BTreeMap::new(), BTreeMap::new());
        for (name, array) in arrays {
            let mut unpacked = array.clone();
            if let Some((packing, bytes)) = packer.pack(name, arrays) {
                assert_eq!(
                    packing.unpacked_bytes(),
                    (array.len() * Number::of(array).bytes()) as u64
                );
                unpacked = packing.unpack(name, &bytes, &again).expect("its own bytes");
                all.insert(name.clone(), (packing, bytes));
            }
            assert!(bits_of(&unpacked) == bits_of(array), "{name}");
            assert_eq!(Number::of(&unpacked), Number::of(array), "{name}");
            again.insert(name.clone(), unpacked);
        }
        all
    }

    fn arrays<const N: usize>(named: [(&str, Array); N]) -> BTreeMap<String, Array> {
        named.into_iter().map(|(name, array)| (name.to_owned(), array)).collect()
    }

    fn random(count: usize, seed: u64) -> impl Iterator<Item = u64> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        (0..count).map(move |_| rng.random())
    }

    #[test]
    fn every_array_is_restored_bit_by_bit() {
        let count = 70_000;
        let any = |seed| random(count, seed);
        let small = || any(5).map(|n| n % 100);
        let all = arrays([
            ("any.f32", any(1).map(|n| f32::from_bits(n as u32)).collect::<Vec<_>>().into()),
            ("any.u16", any(2).map(|n| n as u16).collect::<Vec<_>>().into()),
            ("any.u32", any(3).map(|n| n as u32).collect::<Vec<_>>().into()),
            ("any.u64", any(4).collect::<Vec<_>>().into()),
            ("empty", Vec::<f32>::new().into()),
            ("equal", vec![7.5_f32; count].into()),
            ("few", vec![1_u16, 2, 3].into()),
            ("largest", vec![u64::MAX; count].into()),
            ("small.u16", small().map(|n| n as u16).collect::<Vec<_>>().into()),
            ("small.u32", small().map(|n| n as u32).collect::<Vec<_>>().into()),
            ("small.u64", small().collect::<Vec<_>>().into()),
            ("sorted", (0..count as u32).map(|i| 90_000 + 3 * i).collect::<Vec<_>>().into()),
            ("falling", (0..count as u16).rev().collect::<Vec<_>>().into()),
        ]);
        let packed = packed(&all);
        for (name, most) in
            [("equal", 3_000), ("largest", 6_000), ("sorted", 3_000), ("small.u64", 70_000)]
        {
            assert!(packed[name].1.len() < most, "{name}: {}", packed[name].1.len());
        }
    }

    #[test]
    fn damaged_arrays_are_refused_with_their_name() {
        let numbers: Vec<u32> = random(5_000, 1).map(|n| n as u32 % 1_000).collect();
        let all = arrays([("a", numbers.clone().into()), ("b", numbers.into())]);
        let (packing, bytes) = packed(&all)["b"].clone();
        let unpacked = |packing: &Packing, bytes: &[u8]| packing.unpack("b", bytes, &all);
        assert!(unpacked(&packing, &bytes).is_ok());
        let refused = |packing: &Packing, bytes: &[u8], why: &str| {
            let error = unpacked(packing, bytes).expect_err(why).to_string();
            assert!(error.contains("its b cannot be unpacked") && error.contains(why), "{error}");
        };
        for length in 0..bytes.len() {
            refused(&packing, &bytes[..length], "it is cut off");
        }
        refused(&packing, &[bytes.as_slice(), b"x"].concat(), "something follows it");
        for count in [0, 4_999, 5_001, u64::from(u32::MAX), u64::MAX] {
            refused(&Packing { count, ..packing.clone() }, &bytes, "its length is wrong");
        }
        for of in ["b2", "c"] {
            let prediction = Prediction::Array(of.to_owned());
            refused(&Packing { prediction, ..packing.clone() }, &bytes, "is missing");
        }
        let wrong_type = Packing { number: Number::F32, ..packing.clone() };
        refused(&wrong_type, &bytes, "is missing");
    }

    #[test]
    fn no_change_of_a_byte_does_harm() {
        let numbers: Vec<f32> = random(2_000, 3).map(|n| (n % 50) as f32).collect();
        let all = arrays([("a", numbers.into())]);
        let (packing, bytes) = packed(&all)["a"].clone();
        for at in 0..bytes.len() {
            let mut changed = bytes.clone();
            changed[at] ^= 0x55;
            if let Ok(array) = packing.unpack("a", &changed, &all) {
                assert_eq!(array.len(), 2_000);
            }
        }
    }

    #[test]
    fn a_small_file_does_not_unpack_to_more_than_it_says() {
        let mut encoder = DeflateEncoder::new(Vec::new(), Compression::best());
        encoder.write_all(&vec![0; 50_000_000]).expect("in memory");
        let bomb = encoder.finish().expect("in memory");
        assert!(bomb.len() < 100_000 && inflated(&bomb, 1_000).is_none());
    }
}
