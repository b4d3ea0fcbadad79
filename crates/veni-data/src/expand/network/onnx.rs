//! Networks in ONNX files, run by the `rten` crate.

use std::path::Path;
use std::sync::mpsc::RecvTimeoutError;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use rten::{DataType, Dimension, LoadError, LoadErrorKind, Model, NodeId, Value, ValueType};
use veni_light::digest::Digest;

use super::wire::Fields;
use super::{ExpansionNetwork, graph_check};
use crate::limits::{MAX_ONNX_BYTES, MAX_ONNX_PIXELS, MAX_ONNX_SECONDS};
use crate::{Error, Result};
use veni_light::limits::at_most;

/// The size at which a network that takes any is tried when it is loaded, \[height, width\].
const TRIAL: [usize; 2] = [64, 128];

/// A network from an ONNX file: one float input and one float output of the same shape 1 × 3 × H × W, where sides and batch
/// may be free. Its weights must be in the file itself.
#[derive(Debug)]
pub struct OnnxNetwork {
    name: String,
    digest: Digest,
    model: Model,
    input: NodeId,
    output: NodeId,
    size: [Option<usize>; 2],
    /// One image at a time: a network's intermediate values fill the memory, and it uses all cores by itself.
    turn: Mutex<()>,
}

impl OnnxNetwork {
    /// Loads a network and tries it once, so that one that does not fit is refused before any work.
    ///
    /// # Errors
    /// [`Error::Io`] if the file cannot be read; [`Error::Invalid`] if it is not an ONNX model or damaged, or if its
    /// input or output is not as asked; [`Error::Unsupported`] for operators that the runtime does not have and for
    /// weights in other files.
    pub fn load(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let meta = std::fs::metadata(path).map_err(|e| Error::io(path, "open", e))?;
        if meta.is_dir() {
            return Err(Error::invalid("is a folder, not an ONNX file").in_file(path));
        }
        if meta.len() > MAX_ONNX_BYTES {
            return Err(Error::too_large("is larger than 2 GiB, which no ONNX file is").in_file(path));
        }
        let bytes = std::fs::read(path).map_err(|e| Error::io(path, "read", e))?;
        let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
        Self::parse(name, bytes).map_err(|e| e.in_file(path))
    }

    /// The digest of the file.
    pub fn digest(&self) -> Digest {
        self.digest
    }

    fn parse(name: String, bytes: Vec<u8>) -> Result<Self> {
        let digest = Digest::of(&bytes);
        if !is_whole(&bytes) {
            return Err(Error::invalid("is not an ONNX model, or truncated"));
        }
        graph_check::check(&bytes)?;
        let model = load_in_time(bytes)?;
        let input = only(&model, model.input_ids(), "input")?;
        let output = only(&model, model.output_ids(), "output")?;
        let [height, width] = declared(&model, input)?;
        let network =
            Self { name, digest, model, input, output, size: [height, width], turn: Mutex::new(()) };
        let size = [height.unwrap_or(TRIAL[0]), width.unwrap_or(TRIAL[1])];
        at_most("pixels of input", (size[0] as u64).saturating_mul(size[1] as u64), MAX_ONNX_PIXELS)?;
        let pixels = size[0] * size[1];
        // a ramp: some networks divide by the contrast of what they see
        let ramp = (0..3 * pixels).map(|k| (k % pixels) as f32 / pixels as f32).collect();
        network.try_run(ramp, size)?;
        Ok(network)
    }

    fn try_run(&self, planes: Vec<f32>, [height, width]: [usize; 2]) -> Result<Vec<f32>> {
        let shape = [1, 3, height, width];
        let value = Value::from_shape(&shape, planes)
            .map_err(|e| Error::invalid(format!("its input cannot be made: {e}")))?;
        let run = || {
            let _turn = self.turn.lock().unwrap_or_else(PoisonError::into_inner);
            self.model.run_n(vec![(self.input, value.into())], [self.output], None)
        };
        // a thread of its own: a worker of a thread pool that waits for the runtime's pool takes up another image
        // meanwhile, and would wait there for the turn that it holds itself
        let result = std::thread::scope(|scope| scope.spawn(run).join());
        let [result] = result
            .map_err(|_| Error::invalid("the ONNX runtime gave up on it; the reason stands above"))?
            .map_err(|e| Error::invalid(format!("cannot be run: {}", line(&e))))?;
        let wanted = times(&shape);
        if result.dtype() != ValueType::Tensor(DataType::Float) {
            return Err(Error::invalid(format!(
                "its output is {}; float {wanted} was expected",
                result.dtype()
            )));
        }
        let (found, planes) = result.into_shape_vec::<f32, 4>().map_err(|e| {
            Error::invalid(format!("its output is not an image: for an input of {wanted}, {}", line(&e)))
        })?;
        if found != shape {
            return Err(Error::invalid(format!(
                "its output is {}; for an input of {wanted} the same was expected",
                times(&found)
            )));
        }
        Ok(planes)
    }
}

impl ExpansionNetwork for OnnxNetwork {
    fn name(&self) -> &str {
        &self.name
    }

    fn size(&self) -> [Option<usize>; 2] {
        self.size
    }

    fn run(&self, planes: Vec<f32>, size: [usize; 2]) -> Result<Vec<f32>> {
        self.try_run(planes, size).map_err(|e| e.in_file(&self.name))
    }
}

/// Whether the fields of the outermost message (Protocol Buffers) fill the file: the runtime takes what is left of a
/// truncated graph for a smaller one.
fn is_whole(bytes: &[u8]) -> bool {
    !bytes.is_empty() && Fields::of(bytes).all(|field| field.is_some())
}

/// Loads a checked network on a thread of its own, whose time is limited: what loading does depends on the network, and no
/// check here foresees all of it. A thread that is not done goes on until the program ends.
fn load_in_time(bytes: Vec<u8>) -> Result<Model> {
    let (done, wait) = std::sync::mpsc::channel();
    let work = move || drop(done.send(Model::load(bytes)));
    std::thread::Builder::new()
        .name("onnx".into())
        .spawn(work)
        .map_err(|e| Error::invalid(format!("no thread to load it on: {e}")))?;
    match wait.recv_timeout(Duration::from_secs(MAX_ONNX_SECONDS)) {
        Ok(model) => model.map_err(|e| refusal(&e)),
        Err(RecvTimeoutError::Timeout) => Err(Error::too_large(format!(
            "took the ONNX runtime more than {MAX_ONNX_SECONDS} seconds to load, the limit"
        ))),
        Err(RecvTimeoutError::Disconnected) => {
            Err(Error::invalid("the ONNX runtime gave up on it; the reason stands above"))
        }
    }
}

/// The one input or output that there is to be.
fn only(model: &Model, nodes: &[NodeId], what: &str) -> Result<NodeId> {
    if let [node] = nodes {
        return Ok(*node);
    }
    let names: Vec<_> = nodes.iter().map(|id| name(model, *id)).collect();
    let names = if names.is_empty() { String::new() } else { format!(" ({})", names.join(", ")) };
    Err(Error::invalid(format!(
        "has {} {what}s{names}; one was expected: a tensor 1 x 3 x H x W",
        nodes.len()
    )))
}

fn name(model: &Model, node: NodeId) -> String {
    model.node_info(node).and_then(|info| info.name()).unwrap_or("unnamed").to_owned()
}

/// Height and width of the input where they are declared, if nothing that is declared of it contradicts 1 × 3 × H × W of
/// floats. What the output is, a run tells.
fn declared(model: &Model, node: NodeId) -> Result<[Option<usize>; 2]> {
    let info = model.node_info(node);
    let expected = "float 1 x 3 x H x W (batch, channels, rows, columns) was expected";
    let called = name(model, node);
    if let Some(dtype) = info.as_ref().and_then(|i| i.dtype())
        && dtype != ValueType::Tensor(DataType::Float)
    {
        return Err(Error::invalid(format!("its input '{called}' is {dtype}; {expected}")));
    }
    let Some(shape) = info.and_then(|i| i.shape()) else { return Ok([None, None]) };
    let side = |at: usize| match shape.get(at) {
        Some(Dimension::Fixed(n)) => Some(*n),
        _ => None,
    };
    let fits = |at: usize, wanted: usize| side(at).is_none_or(|n| n == wanted);
    if shape.len() == 4 && fits(0, 1) && fits(1, 3) && side(2) != Some(0) && side(3) != Some(0) {
        return Ok([side(2), side(3)]);
    }
    let found: Vec<String> = shape
        .iter()
        .map(|d| match d {
            Dimension::Fixed(n) => n.to_string(),
            Dimension::Symbolic(name) => name.clone(),
        })
        .collect();
    let last = if shape.len() == 4 && side(3) == Some(3) { ", channels before rows and columns" } else { "" };
    Err(Error::invalid(format!("its input '{called}' is {}; {expected}{last}", found.join(" x "))))
}

fn times(shape: &[usize]) -> String {
    shape.iter().map(usize::to_string).collect::<Vec<_>>().join(" x ")
}

/// Why a model was not loaded.
fn refusal(error: &LoadError) -> Error {
    let text = line(error);
    let elsewhere = error.kind() == LoadErrorKind::ExternalDataError || text.contains("external data");
    match error.kind() {
        _ if elsewhere => Error::unsupported(
            "its weights are in other files; save the model as one file (torch.onnx.export with external_data=False)",
        ),
        LoadErrorKind::OperatorInvalid => {
            Error::unsupported(format!("has an operator that the ONNX runtime (rten) cannot run: {text}"))
        }
        LoadErrorKind::UnknownFileType | LoadErrorKind::ParseError | LoadErrorKind::FormatNotEnabled => {
            Error::invalid(format!("is not an ONNX model, or damaged: {text}"))
        }
        _ => Error::invalid(format!("the ONNX runtime (rten) cannot load it: {text}")),
    }
}

/// An error as one line.
fn line(error: &dyn std::fmt::Display) -> String {
    error.to_string().split_whitespace().collect::<Vec<_>>().join(" ")
}
