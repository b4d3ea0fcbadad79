//! The content of something as one short name.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize, Serializer};
use sha2::{Digest as _, Sha256};

use crate::{Error, Result};

/// The first 8 bytes of a SHA-256; as text and in JSON 16 lower-case hexadecimal digits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Digest([u8; 8]);

impl Digest {
    /// Of all these bytes.
    pub fn of(bytes: impl AsRef<[u8]>) -> Self {
        Self::build().update(bytes).finish()
    }

    /// Of bytes that come in parts; where one part ends does not matter.
    pub fn build() -> DigestBuilder {
        DigestBuilder(Sha256::new())
    }

    /// The 8 bytes as a number, the first byte the most significant.
    pub fn number(self) -> u64 {
        u64::from_be_bytes(self.0)
    }
}

/// A [`Digest`] in the making.
#[derive(Clone, Debug)]
pub struct DigestBuilder(Sha256);

impl DigestBuilder {
    /// With these bytes next.
    #[must_use]
    pub fn update(mut self, bytes: impl AsRef<[u8]>) -> Self {
        self.0.update(bytes);
        self
    }

    /// The digest of all parts.
    pub fn finish(self) -> Digest {
        let [a, b, c, d, e, f, g, h, ..] = <[u8; 32]>::from(self.0.finalize());
        Digest([a, b, c, d, e, f, g, h])
    }
}

impl fmt::Display for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:016x}", self.number())
    }
}

impl Serialize for Digest {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Digest {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(serde::de::Error::custom)
    }
}

impl FromStr for Digest {
    type Err = Error;

    /// # Errors
    /// [`Error::Invalid`] unless there are 16 lower-case hexadecimal digits.
    fn from_str(text: &str) -> Result<Self> {
        let digits = text.len() == 16 && text.bytes().all(|b| matches!(b, b'0'..=b'9' | b'a'..=b'f'));
        let number = u64::from_str_radix(text, 16).ok().filter(|_| digits);
        number
            .map(|number| Self(number.to_be_bytes()))
            .ok_or_else(|| Error::invalid(format!("{text:?} is not a digest: 16 digits of 0-9, a-f")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_standards_example_is_met_and_parts_join() {
        // FIPS 180-4: SHA-256("abc") = ba7816bf 8f01cfea …
        let digest = Digest::of("abc");
        assert_eq!(digest.to_string(), "ba7816bf8f01cfea");
        assert_eq!(serde_json::to_string(&digest).unwrap(), "\"ba7816bf8f01cfea\"");
        assert_eq!(digest.number(), 0xba78_16bf_8f01_cfea);
        assert_eq!(Digest::build().update("a").update([]).update(b"bc").finish(), digest);
        assert_ne!(Digest::of("abd"), digest);
    }

    #[test]
    fn text_comes_back_and_other_text_is_refused() {
        let small: Digest = "00000000000000ff".parse().unwrap();
        assert_eq!((small.to_string().as_str(), small.number()), ("00000000000000ff", 255));
        assert!(small < Digest::of("abc"));
        assert_eq!(serde_json::from_str::<Digest>("\"00000000000000ff\"").unwrap(), small);
        for text in ["", "ff", "BA7816BF8F01CFEA", "+a7816bf8f01cfea", "ba7816bf8f01cfeag", "ba7816bf8f01cfé"]
        {
            assert!(text.parse::<Digest>().unwrap_err().to_string().contains("not a digest"), "{text}");
            let json = serde_json::to_string(text).unwrap();
            assert!(serde_json::from_str::<Digest>(&json).unwrap_err().to_string().contains("not a digest"));
        }
    }
}
