//! Multi-head self-attention among tokens of vectors.

use super::linear::{Feature, Linear, Prepared};
use super::matrix::{Matrix, PANEL, PackedRows, Product, Rows, padded};
use super::softmax::Softmax;
use super::weights::{Shape, Tensors};
use super::workspace::grown;

/// Looking tokens at a time: bounds the logits in memory.
const BLOCK: usize = 96;

/// softmax(⟨q_t, k_s⟩ / √(head channels · coordinates)) over tokens s, applied to v_s, per head.
#[derive(Clone, Debug)]
pub(super) struct Attention {
    /// Times 1/√(head channels · coordinates).
    pub(super) query: Linear,
    /// Keys, then values.
    pub(super) key_value: Linear,
    pub(super) out: Linear,
    pub(super) heads: usize,
    /// Channels of a head.
    head: usize,
    coordinates: usize,
}

/// Workspace for one head.
#[derive(Debug, Default)]
pub(super) struct Workspace {
    rows: Vec<f32>,
    packed: PackedRows,
    keys: Matrix,
    values: Matrix,
    logits: Vec<f32>,
}

impl Attention {
    /// `into` and `out` are the shapes of the maps into and out of the heads.
    pub(super) fn new(tensors: Tensors<'_>, name: &str, [into, out]: [Shape; 2], heads: usize) -> Self {
        let names = |parts: &[&str]| parts.iter().map(|part| format!("{name}.{part}")).collect::<Vec<_>>();
        let (head, coordinates) = (into.outputs / heads, into.from);
        let scale = 1.0 / ((head * coordinates) as f32).sqrt();
        Self {
            query: Linear::new(tensors, &names(&["query"]), into, scale),
            key_value: Linear::new(tensors, &names(&["key", "value"]), into, 1.0),
            out: Linear::new(tensors, &names(&["out"]), out, 1.0),
            heads,
            head,
            coordinates,
        }
    }

    /// Numbers that one head gives for a token: coordinate-major, filled up to whole panels.
    pub(super) fn seen_width(&self) -> usize {
        padded(self.coordinates * self.head)
    }

    /// What head `h` sees: `[looking token, seen_width]` from `[looking token, coordinate, inner]` and
    /// `[token, coordinate, 2 · inner]`.
    pub(super) fn look(
        &self,
        h: usize,
        query: &[f32],
        key_value: &[f32],
        seen: &mut [f32],
        workspace: &mut Workspace,
    ) {
        let (coordinates, head, inner) = (self.coordinates, self.head, self.query.width());
        let tokens = key_value.len() / (2 * inner * coordinates);
        let width = coordinates * head;
        let (keys, values) = (&mut workspace.keys, &mut workspace.values);
        keys.reset(width, tokens);
        values.reset(tokens, width);
        for (s, token) in key_value.chunks_exact(2 * inner * coordinates).enumerate() {
            for (c, channels) in token.chunks_exact(2 * inner).enumerate() {
                keys.put_column(c * head, s, &channels[h * head..][..head]);
                values.put(s, c * head, &channels[inner + h * head..][..head]);
            }
        }
        let queries = query.chunks(BLOCK * inner * coordinates);
        for (query, seen) in queries.zip(seen.chunks_mut(BLOCK * self.seen_width())) {
            let count = query.len() / (inner * coordinates);
            workspace.rows.clear();
            for channels in query.chunks_exact(inner) {
                workspace.rows.extend_from_slice(&channels[h * head..][..head]);
            }
            workspace.packed.pack(Rows { data: &workspace.rows, stride: width, count }, width);
            let stride = keys.outputs();
            let logits = grown(&mut workspace.logits, count * stride);
            let (x, panels) = (&workspace.packed, 0..keys.panels());
            Product { x, weight: keys, panels, y: logits, stride, add: false }.run();
            Softmax { rows: logits, stride, count: tokens }.run();
            workspace.packed.pack(Rows { data: logits, stride, count }, tokens);
            let (x, panels, stride) = (&workspace.packed, 0..values.panels(), self.seen_width());
            Product { x, weight: values, panels, y: seen, stride, add: false }.run();
        }
    }

    /// The map out of the heads for looking tokens from `first` on. `seen` is `[head, looking token, seen_width]`,
    /// `y` `[token, coordinate, width]`.
    pub(super) fn gather(
        &self,
        seen: &[f32],
        first: usize,
        y: &mut [f32],
        workspace: &mut (Vec<f32>, Prepared),
    ) {
        let (coordinates, head, width) = (self.coordinates, self.head, self.seen_width());
        let channels = self.heads * head;
        let inner = channels.next_multiple_of(PANEL);
        let count = y.len() / (coordinates * self.out.width());
        let (rows, prepared) = workspace;
        let rows = grown(rows, count * coordinates * inner);
        for (h, seen) in seen.chunks_exact(seen.len() / self.heads).enumerate() {
            let seen = seen[first * width..].chunks_exact(width);
            for (token, seen) in rows.chunks_exact_mut(coordinates * inner).zip(seen) {
                for (row, seen) in token.chunks_exact_mut(inner).zip(seen.chunks_exact(head)) {
                    row[h * head..][..head].copy_from_slice(seen);
                }
            }
        }
        prepared.prepare(self.out.layer(), Feature { data: rows, coordinates, channels, width: inner });
        self.out.apply(prepared, y);
    }
}
