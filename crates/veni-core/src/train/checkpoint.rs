//! The state of a run on disk: one safetensors file, replaced as a whole.
//!
//! Tensors are [`Optimiser::state`](crate::train::optimiser::Optimiser::state); everything random is named by
//! its step, so the step count is all that is needed beside them. The metadata entry `veni-checkpoint` is JSON.

use std::io::Write;
use std::path::Path;

use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::{Deserialize, Serialize};

use crate::limits::MAX_CHECKPOINT_BYTES;
use crate::vae::weights::Weights;
use crate::{Error, Result};
use veni_light::limits::read_file;
use veni_light::model::Array;
use veni_light::output::{Overwrite, write_atomic};

const KEY: &str = "veni-checkpoint";
const FORMAT: u32 = 1;

/// What a checkpoint holds beside tensors.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CheckpointInfo {
    /// Version of this layout.
    pub format: u32,
    /// Updates made.
    pub step: u64,
    /// The best validation so far.
    pub best: Option<BestValidation>,
}

/// The validation by which `model.safetensors` was chosen.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BestValidation {
    /// After how many updates.
    pub step: u64,
    /// Mean LDR PSNR over the validation panoramas, dB.
    pub ldr_psnr: f64,
}

impl CheckpointInfo {
    /// The description of a state after `step` updates.
    pub fn new(step: u64, best: Option<BestValidation>) -> Self {
        Self { format: FORMAT, step, best }
    }
}

/// Writes the checkpoint, replacing the previous one once this one is complete.
///
/// # Errors
/// [`Error::Io`] if the file cannot be written; the previous checkpoint is then intact.
pub fn save(path: &Path, state: &Weights, info: &CheckpointInfo) -> Result<()> {
    let json = serde_json::to_string(info).map_err(|e| Error::invalid(format!("checkpoint header: {e}")))?;
    let bytes: Vec<_> = state.values().map(|v| little_endian(&v.data)).collect();
    let mut views = Vec::with_capacity(bytes.len());
    for ((name, values), bytes) in state.iter().zip(&bytes) {
        let view = TensorView::new(Dtype::F32, values.shape.clone(), bytes);
        views.push((name.as_str(), view.map_err(|e| Error::invalid(format!("tensor {name}: {e}")))?));
    }
    let header = [(KEY.to_owned(), json)].into_iter().collect();
    let file = safetensors::serialize(views, Some(header))
        .map_err(|e| Error::invalid(format!("checkpoint: {e}")))?;
    write_atomic(path, Overwrite::Replace, |out| {
        out.write_all(&file).map_err(|e| Error::io(path, "write", e))
    })
}

/// Reads a checkpoint.
///
/// # Errors
/// [`Error::Io`] if it cannot be read; [`Error::Invalid`] if it is damaged; [`Error::Unsupported`] for a format
/// of another version. All name the file.
pub fn load(path: &Path) -> Result<(Weights, CheckpointInfo)> {
    let bytes = read_file(path, "a checkpoint", MAX_CHECKPOINT_BYTES)?;
    parse(&bytes).map_err(|e| e.in_file(path))
}

fn parse(bytes: &[u8]) -> Result<(Weights, CheckpointInfo)> {
    let damaged = |e: &dyn std::fmt::Display| Error::invalid(format!("damaged checkpoint: {e}"));
    let (_, header) = SafeTensors::read_metadata(bytes).map_err(|e| damaged(&e))?;
    let json = header.metadata().as_ref().and_then(|m| m.get(KEY));
    let json = json.ok_or_else(|| damaged(&format!("no header entry {KEY}")))?;
    let value: serde_json::Value = serde_json::from_str(json).map_err(|e| damaged(&e))?;
    if value["format"] != FORMAT {
        return Err(Error::unsupported(format!(
            "checkpoint format {} (this program reads {FORMAT}); continue with the program that wrote it",
            value["format"]
        )));
    }
    let info: CheckpointInfo = serde_json::from_value(value).map_err(|e| damaged(&e))?;
    let file = SafeTensors::deserialize(bytes).map_err(|e| damaged(&e))?;
    let mut state = Weights::new();
    for (name, view) in file.iter() {
        if view.dtype() != Dtype::F32 {
            return Err(damaged(&format!("tensor {name} is {:?}, not F32", view.dtype())));
        }
        let data: Vec<f32> =
            view.data().chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
        if let Some(bad) = data.iter().find(|v| !v.is_finite()) {
            return Err(damaged(&format!("tensor {name} holds {bad}")));
        }
        state.insert(name.to_owned(), Array { shape: view.shape().to_vec(), data });
    }
    Ok((state, info))
}

fn little_endian(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn what_is_saved_comes_back_to_the_bit_and_damage_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("state.safetensors");
        let values = Array { shape: vec![2, 1], data: vec![0.1, -3e-30] };
        let state = Weights::from([("first.a".to_owned(), values)]);
        let info = CheckpointInfo::new(7, Some(BestValidation { step: 5, ldr_psnr: 16.90000001 }));
        save(&path, &state, &info).unwrap();
        save(&path, &state, &info).unwrap();
        assert_eq!(load(&path).unwrap(), (state.clone(), info.clone()));

        let bytes = fs::read(&path).unwrap();
        fs::write(&path, &bytes[..bytes.len() - 3]).unwrap();
        let message = load(&path).unwrap_err().to_string();
        assert!(message.contains("state.safetensors") && message.contains("damaged"), "{message}");
        save(&path, &state, &CheckpointInfo { format: 9, ..info }).unwrap();
        assert!(matches!(load(&path).unwrap_err(), Error::Unsupported { .. }));
    }
}
