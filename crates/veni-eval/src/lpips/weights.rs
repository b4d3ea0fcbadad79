//! The weights of LPIPS with AlexNet from the files in which people have them.
//!
//! | weight | accepted names (with anything and a dot before them) |
//! |---|---|
//! | convolution 0…4, [out, in, k, k] and [out] | `features.N.weight`, `features.N.bias` (torchvision's AlexNet, N = 0, 3, 6, 8, 10); `net.sliceK.N.…`, `sliceK.N.…` (`lpips`, torchmetrics, the reference's checkpoints; K = 1…5) |
//! | head 0…4, [1, channels, 1, 1] | `linL.model.1.weight`, `lins.L.model.1.weight`, L = 0…4 |

use std::path::{Path, PathBuf};

use crate::{Error, Result};
use veni_core::import::Checkpoint;
use veni_light::model::Array;

/// A convolution of AlexNet's feature extractor.
#[derive(Clone, Copy, Debug)]
pub(super) struct Convolution {
    /// Its place among torchvision's `features`.
    pub(super) index: usize,
    pub(super) inputs: usize,
    pub(super) outputs: usize,
    pub(super) kernel: usize,
    pub(super) stride: usize,
    pub(super) padding: usize,
    /// Whether a 3 × 3 maximum with stride 2 comes before it.
    pub(super) pooled: bool,
}

const fn convolution(
    index: usize,
    [inputs, outputs]: [usize; 2],
    kernel: usize,
    pooled: bool,
) -> Convolution {
    let (stride, padding) = if index == 0 { (4, 2) } else { (1, kernel / 2) };
    Convolution { index, inputs, outputs, kernel, stride, padding, pooled }
}

/// AlexNet as torchvision builds it (Krizhevsky 2014, "One weird trick").
pub(super) const LAYERS: [Convolution; 5] = [
    convolution(0, [3, 64], 11, false),
    convolution(3, [64, 192], 5, true),
    convolution(6, [192, 384], 3, true),
    convolution(8, [384, 256], 3, false),
    convolution(10, [256, 256], 3, false),
];

/// The weights of one layer and its head.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LayerWeights {
    /// [out, in, k, k], row-major.
    pub(super) weight: Vec<f32>,
    /// [out].
    pub(super) bias: Vec<f32>,
    /// [out].
    pub(super) head: Vec<f32>,
}

/// Finds all weights in `files`.
///
/// # Errors
/// [`Error::Invalid`] if one is missing, ambiguous, of another shape or not finite; otherwise as reading fails.
pub(super) fn load(files: &[PathBuf]) -> Result<Vec<LayerWeights>> {
    let open = files.iter().map(|path| Checkpoint::open(path).map(|file| (path.as_path(), file)));
    let files = open.collect::<Result<Vec<_>>>()?;
    let layer = |(at, layer): (usize, &Convolution)| {
        let Convolution { index, inputs, outputs, kernel, .. } = *layer;
        let convolution = |part: &str, shape: &[usize]| {
            let names = [
                format!("features.{index}.{part}"),
                format!("net.slice{}.{index}.{part}", at + 1),
                format!("slice{}.{index}.{part}", at + 1),
            ];
            find(&files, &names, shape)
        };
        let heads = [format!("lin{at}.model.1.weight"), format!("lins.{at}.model.1.weight")];
        Ok(LayerWeights {
            weight: convolution("weight", &[outputs, inputs, kernel, kernel])?,
            bias: convolution("bias", &[outputs])?,
            head: find(&files, &heads, &[1, outputs, 1, 1])?,
        })
    };
    LAYERS.iter().enumerate().map(layer).collect()
}

/// The tensor under the first of `names` that a file has.
fn find(files: &[(&Path, Checkpoint)], names: &[String], shape: &[usize]) -> Result<Vec<f32>> {
    for name in names {
        let ends =
            |full: &str| full.strip_suffix(name.as_str()).is_some_and(|r| r.is_empty() || r.ends_with('.'));
        let hits = files.iter().flat_map(|(path, file)| {
            file.names().filter(|full| ends(full)).map(move |full| (*path, file, full))
        });
        match hits.collect::<Vec<_>>().as_slice() {
            [] => {}
            [(path, file, full)] => {
                let Array { shape: found, data } = file.tensor(full).map_err(|e| e.in_file(path))?;
                if found != shape {
                    return Err(Error::invalid(format!(
                        "tensor {full} is {found:?}, LPIPS with AlexNet has {shape:?}"
                    ))
                    .in_file(path));
                }
                return Ok(data);
            }
            [(one, _, first), (two, _, second), ..] => {
                return Err(Error::invalid(format!(
                    "{first} ({}) and {second} ({}) could both be {name}: name the files of one network only",
                    one.display(),
                    two.display()
                )));
            }
        }
    }
    let files: Vec<_> = files.iter().map(|(path, _)| path.display().to_string()).collect();
    Err(Error::invalid(format!(
        "{}: no tensor {}: LPIPS needs AlexNet's features (torchvision's file) and the five linear heads (the lpips \
         package's file); name every file that is needed",
        files.join(", "),
        names.join(" or ")
    )))
}
