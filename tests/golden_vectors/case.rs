//! One golden file: its metadata, its tensors, and what has been compared with it so far.
//!
//! Without burn, because the tests of the encoder without burn read the same files.

use super::compare::{self, Tolerance};
use super::filler;
use serde_json::Value;
use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Numbers with a shape, row-major. Integers and booleans of a file are widened to f32.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Data {
    pub(crate) shape: Vec<usize>,
    pub(crate) values: Vec<f32>,
}

impl Data {
    pub(crate) fn new(shape: impl Into<Vec<usize>>, values: Vec<f32>) -> Self {
        let shape = shape.into();
        assert_eq!(shape.iter().product::<usize>(), values.len(), "{shape:?} does not hold {}", values.len());
        Self { shape, values }
    }

    /// The numbers viewed as `view`, axes then in `order`.
    pub(crate) fn permuted(&self, view: &[usize], order: &[usize]) -> Self {
        let strides: Vec<usize> = (0..view.len()).map(|axis| view[axis + 1..].iter().product()).collect();
        let shape: Vec<usize> = order.iter().map(|&axis| view[axis]).collect();
        let count: usize = shape.iter().product();
        assert_eq!(count, self.values.len(), "cannot view {:?} as {view:?}", self.shape);
        let values = (0..count).map(|mut index| {
            let mut from = 0;
            for (&size, &axis) in shape.iter().zip(order).rev() {
                from += index % size * strides[axis];
                index /= size;
            }
            self.values[from]
        });
        Self::new(shape.clone(), values.collect())
    }

    /// A scalar (shape []).
    pub(crate) fn scalar(value: f32) -> Self {
        Self::new([], vec![value])
    }

    /// Rows and columns exchanged: the reference's `[out, in]` to our `[in, out]` and back.
    pub(crate) fn transposed(&self) -> Self {
        let [rows, columns] = self.shape[..] else {
            panic!("transposing a tensor of shape {:?}", self.shape)
        };
        let values =
            (0..columns).flat_map(|c| (0..rows).map(move |r| self.values[r * columns + c])).collect();
        Self::new([columns, rows], values)
    }
}

/// One case file.
pub(crate) struct Case {
    /// File name without extension.
    pub(crate) name: String,
    /// Hyper-parameters with the reference's option names.
    pub(crate) config: Value,
    /// The file's remark, or empty.
    pub(crate) note: String,
    folder: PathBuf,
    tolerances: BTreeMap<String, Tolerance>,
    pub(crate) tensors: BTreeMap<String, Data>,
    compared: RefCell<BTreeSet<String>>,
    failures: RefCell<Vec<String>>,
    ratios: RefCell<Vec<(f64, String)>>,
}

impl Case {
    /// Reads a case file; the error names what is wrong with it.
    pub(crate) fn load(path: &Path) -> Result<Self, String> {
        let bytes = std::fs::read(path).map_err(|e| e.to_string())?;
        let (_, header) = safetensors::SafeTensors::read_metadata(&bytes).map_err(|e| e.to_string())?;
        let file = safetensors::SafeTensors::deserialize(&bytes).map_err(|e| e.to_string())?;
        let metadata = header.metadata().clone().unwrap_or_default();
        let json = |key: &str| match metadata.get(key) {
            Some(text) => serde_json::from_str(text).map_err(|e| format!("metadata `{key}`: {e}")),
            None => Ok(Value::Null),
        };
        let tensors = file.iter().map(|(name, view)| Ok((name.to_owned(), widen(name, &view)?)));
        Ok(Self {
            name: path.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
            config: json("config")?,
            note: metadata.get("note").cloned().unwrap_or_default(),
            folder: path.parent().map_or_else(PathBuf::new, Path::to_path_buf),
            tolerances: compare::tolerances(&json("tol")?)?,
            tensors: tensors.collect::<Result<_, String>>()?,
            compared: RefCell::default(),
            failures: RefCell::default(),
            ratios: RefCell::default(),
        })
    }

    /// The same file, with nothing compared yet.
    pub(crate) fn clone_without_results(&self) -> Self {
        Self {
            name: self.name.clone(),
            config: self.config.clone(),
            note: self.note.clone(),
            folder: self.folder.clone(),
            tolerances: self.tolerances.clone(),
            tensors: self.tensors.clone(),
            compared: RefCell::default(),
            failures: RefCell::default(),
            ratios: RefCell::default(),
        }
    }

    /// The file.
    pub(crate) fn path(&self) -> PathBuf {
        self.folder.join(format!("{}.safetensors", self.name))
    }

    /// Another case of the same folder, or `None` where that file is not there.
    pub(crate) fn sibling(&self, name: &str) -> Option<Self> {
        let path = self.folder.join(format!("{name}.safetensors"));
        path.is_file().then(|| Self::load(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display())))
    }

    /// `config.module`, or the empty string.
    pub(crate) fn module(&self) -> &str {
        self.text("module").unwrap_or_default()
    }

    /// A text option of the configuration.
    pub(crate) fn text(&self, key: &str) -> Option<&str> {
        self.config.get(key).and_then(Value::as_str)
    }

    /// A numeric option of the configuration.
    pub(crate) fn number(&self, key: &str) -> Option<f64> {
        self.config.get(key).and_then(Value::as_f64)
    }

    /// A size in the configuration.
    pub(crate) fn size(&self, key: &str) -> Option<usize> {
        self.config.get(key).and_then(Value::as_u64).map(|v| v as usize)
    }

    /// A tensor that may be absent.
    pub(crate) fn get(&self, name: &str) -> Option<&Data> {
        self.tensors.get(name)
    }

    /// A tensor that must be there.
    pub(crate) fn data(&self, name: &str) -> &Data {
        self.get(name).unwrap_or_else(|| panic!("the case has no tensor `{name}`"))
    }

    /// The weight with the reference's key `key`: `param.<key>`, or generated for filler cases, where the
    /// recorded first values `check.<key>` are verified. `None` where the case has neither.
    pub(crate) fn weight(&self, key: &str, shape: &[usize]) -> Option<Data> {
        if let Some(data) = self.get(&format!("param.{key}")) {
            assert_eq!(
                data.shape, shape,
                "`param.{key}` does not have the shape that the configuration implies"
            );
            return Some(data.clone());
        }
        let seed = self.config.get("filler_seed").and_then(Value::as_u64)?;
        let data = Data::new(shape, filler::weight(key, shape, seed));
        if let Some(check) = self.get(&format!("check.{key}")) {
            assert_eq!(data.values[..check.values.len()], check.values[..], "filler weights of `{key}`");
        }
        Some(data)
    }

    /// Compares our numbers with the tensor `name` (`out.*`, `grad.*`), in row-major order.
    /// The number of elements must agree; sizes of one may differ in the shape.
    pub(crate) fn compare(&self, name: &str, ours: &Data) {
        self.compare_within(name, ours, 0.0);
    }

    /// [`compare`](Self::compare), allowing at least `deviation`: what an input that the file does not record
    /// is known to change.
    pub(crate) fn compare_within(&self, name: &str, ours: &Data, deviation: f64) {
        let golden = self.data(name);
        self.compared.borrow_mut().insert(name.to_owned());
        let tolerance = self.tolerances.get(name).copied().unwrap_or(Tolerance::UNKNOWN);
        match compare::check(ours, golden, tolerance.at_least(deviation)) {
            Ok(ratio) => self.ratios.borrow_mut().push((ratio, name.to_owned())),
            Err(message) => self.failures.borrow_mut().push(format!("{name}: {message}")),
        }
    }

    /// Whether [`compare`](Self::compare) would pass; nothing is recorded.
    pub(crate) fn agrees(&self, name: &str, ours: &Data) -> bool {
        let tolerance = self.tolerances.get(name).copied().unwrap_or(Tolerance::UNKNOWN);
        compare::check(ours, self.data(name), tolerance).is_ok()
    }

    /// [`compare`](Self::compare) for one number.
    pub(crate) fn compare_scalar(&self, name: &str, ours: f64) {
        self.compare(name, &Data::scalar(ours as f32));
    }

    /// Whether something is to be compared under this name.
    pub(crate) fn expects(&self, name: &str) -> bool {
        self.tensors.contains_key(name)
    }

    /// Whether the file says how far f32 may be off.
    pub(crate) fn has_tolerances(&self) -> bool {
        !self.tolerances.is_empty()
    }

    /// Takes a tensor as compared: the process that computes in the other precision does it.
    pub(crate) fn leave_to_the_other_process(&self, name: &str) {
        self.compared.borrow_mut().insert(name.to_owned());
    }

    /// What was compared and failed.
    pub(crate) fn mismatches(&self) -> Vec<String> {
        self.failures.borrow().clone()
    }

    /// How many tensors were compared.
    pub(crate) fn comparisons(&self) -> usize {
        self.compared.borrow().len()
    }

    /// The tensors within the tolerance and how much of it they use, 0 to 1.
    pub(crate) fn ratios(&self) -> Vec<(f64, String)> {
        self.ratios.borrow().clone()
    }

    /// What failed so far, and every output or gradient of the file that nobody compared.
    pub(crate) fn failures(&self) -> Vec<String> {
        let compared = self.compared.borrow();
        let expected = |n: &&String| n.starts_with("out.") || n.starts_with("grad.");
        let missed = self.tensors.keys().filter(expected).filter(|n| !compared.contains(*n));
        let missed = missed.map(|n| format!("{n}: in the file, but never compared"));
        self.failures.borrow().iter().cloned().chain(missed).collect()
    }
}

/// Little-endian f32, i32 or u8 to f32.
fn widen(name: &str, view: &safetensors::tensor::TensorView<'_>) -> Result<Data, String> {
    use safetensors::Dtype;
    let bytes = view.data();
    let words = || bytes.as_chunks::<4>().0.iter();
    let values: Vec<f32> = match view.dtype() {
        Dtype::F32 => words().map(|b| f32::from_le_bytes(*b)).collect(),
        Dtype::I32 => words().map(|b| i32::from_le_bytes(*b) as f32).collect(),
        Dtype::U8 | Dtype::BOOL => bytes.iter().map(|&b| f32::from(b)).collect(),
        other => return Err(format!("tensor `{name}` has type {other:?}; f32, i32 and u8 are read")),
    };
    Ok(Data::new(view.shape(), values))
}
