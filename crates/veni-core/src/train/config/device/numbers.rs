//! Which devices of a kind.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::{Error, Result};

/// Numbers of devices, counted from 0, at least one, each once; written `0,1,3`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "Written", into = "String")]
pub struct Devices(Vec<usize>);

impl Devices {
    /// The first `count`, at least one.
    pub fn first(count: usize) -> Self {
        Self((0..count.max(1)).collect())
    }

    /// How many.
    pub fn count(&self) -> usize {
        self.0.len()
    }

    /// Their numbers, in the order in which they were named.
    pub fn numbers(&self) -> &[usize] {
        &self.0
    }
}

impl Default for Devices {
    /// Device 0.
    fn default() -> Self {
        Self::first(1)
    }
}

impl FromStr for Devices {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let wrong = |why: &str| Error::invalid(format!("devices {text}: {why}; give numbers such as 0,1"));
        let numbers: Vec<usize> =
            (text.split(',').map(|number| number.trim().parse()).collect::<Result<_, _>>())
                .map_err(|_| wrong("these are not numbers from 0, separated by commas"))?;
        match numbers.iter().enumerate().find(|(at, number)| numbers[..*at].contains(number)) {
            Some((_, twice)) => Err(wrong(&format!("{twice} is named twice"))),
            None => Ok(Self(numbers)),
        }
    }
}

impl fmt::Display for Devices {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let numbers: Vec<_> = self.0.iter().map(ToString::to_string).collect();
        f.write_str(&numbers.join(","))
    }
}

/// One number may stand without quotes.
#[derive(Deserialize)]
#[serde(untagged)]
enum Written {
    One(usize),
    Text(String),
}

impl TryFrom<Written> for Devices {
    type Error = Error;

    fn try_from(written: Written) -> Result<Self> {
        match written {
            Written::One(number) => Ok(Self(vec![number])),
            Written::Text(text) => text.parse(),
        }
    }
}

impl From<Devices> for String {
    fn from(devices: Devices) -> Self {
        devices.to_string()
    }
}
