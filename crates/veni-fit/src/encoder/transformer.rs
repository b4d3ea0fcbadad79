//! The transformer over the tokens of one image.

use veni_light::model::EncoderConfig;

use super::attention::{self, Attention};
use super::feed_forward::{self, FeedForward};
use super::linear::{Feature, Prepared};
use super::matrix::padded;
use super::norm::AddNormalised;
use super::parallel::for_each;
use super::weights::{Shapes, Tensors};
use super::workspace::{Pool, grown};

/// Most tokens of one task: what they need stays in the second-level cache.
const TOKENS: usize = 33;

/// X ← X + LN(Attention(X)), then X ← X + LN(FeedForward(X)).
#[derive(Clone, Debug)]
struct Block {
    attention: Attention,
    /// γ, filled up with zeros.
    norm1: Vec<f32>,
    feed_forward: FeedForward,
    norm2: Vec<f32>,
}

/// A chain of blocks.
#[derive(Debug)]
pub(super) struct Transformer {
    blocks: Vec<Block>,
    channels: usize,
    coordinates: usize,
    workspaces: Pool<Workspace>,
    heads: Pool<attention::Workspace>,
}

/// Workspace for a block of tokens.
#[derive(Debug, Default)]
struct Workspace {
    gathered: (Vec<f32>, Prepared),
    branch: Vec<f32>,
    lengths: Vec<f32>,
    feed_forward: feed_forward::Workspace,
}

/// What the tokens of an image need between blocks.
#[derive(Debug, Default)]
pub(super) struct Buffers {
    /// The tokens, `[token, coordinate, width]`.
    pub(super) x: Vec<f32>,
    query: Vec<f32>,
    key_value: Vec<f32>,
    seen: Vec<f32>,
}

impl Transformer {
    /// Of tensors under `name`, e.g. `encoder.transformer`.
    pub(super) fn new(tensors: Tensors<'_>, name: &str, config: &EncoderConfig, shapes: &Shapes) -> Self {
        let gain = |name: String| {
            let mut gamma = tensors.get(&name).to_vec();
            gamma.resize(padded(gamma.len()), 0.0);
            gamma
        };
        let block = |l: usize| {
            let part = |part: &str| format!("{name}.layers.{l}.{part}");
            let heads = [shapes.into_heads, shapes.out_of_heads];
            let maps = [shapes.expand, shapes.contract];
            Block {
                attention: Attention::new(tensors, &part("attention"), heads, config.heads),
                norm1: gain(part("norm1.gamma")),
                feed_forward: FeedForward::new(tensors, &part("feed_forward"), maps, config.vn_relu),
                norm2: gain(part("norm2.gamma")),
            }
        };
        Self {
            blocks: (0..config.depth).map(block).collect(),
            channels: config.channels,
            coordinates: shapes.inner,
            workspaces: Pool::default(),
            heads: Pool::default(),
        }
    }

    /// Numbers of a token.
    pub(super) fn token(&self) -> usize {
        self.coordinates * padded(self.channels)
    }

    /// Applies all blocks to `buffers.x`. With `first_only` the last one computes the first token alone, which looks
    /// at all of them.
    pub(super) fn run(&self, buffers: &mut Buffers, first_only: bool, workers: usize) {
        let tokens = buffers.x.len() / self.token();
        for l in 0..self.blocks.len() {
            let looking = if first_only && l + 1 == self.blocks.len() { 1 } else { tokens };
            self.enter(l, buffers, looking, workers);
            self.look(l, buffers, looking, workers);
        }
        let Buffers { x, seen, .. } = buffers;
        let looking = if first_only { 1 } else { tokens };
        let share = share(looking, workers);
        let tasks = x[..looking * self.token()].chunks_mut(share * self.token()).enumerate();
        for_each(workers, tasks.collect(), |(t, x)| {
            self.workspaces.with(|workspace| self.finish(self.blocks.last(), seen, t * share, x, workspace));
        });
    }

    /// The rest of the block before block `l`, then this one's keys and values of all tokens and queries of the first
    /// `looking`.
    fn enter(&self, l: usize, buffers: &mut Buffers, looking: usize, workers: usize) {
        let Buffers { x, query, key_value, seen } = buffers;
        let attention = &self.blocks[l].attention;
        let layer = attention.query.layer();
        let before = l.checked_sub(1).map(|l| &self.blocks[l]);
        let tokens = x.len() / self.token();
        let (share, inner) = (share(tokens, workers), self.coordinates * attention.query.width());
        let queries = grown(query, tokens * inner);
        let key_values = grown(key_value, tokens * 2 * inner).chunks_mut(share * 2 * inner);
        let tasks = x.chunks_mut(share * self.token()).zip(queries.chunks_mut(share * inner)).zip(key_values);
        for_each(workers, tasks.enumerate().collect(), |(t, ((x, query), key_value))| {
            self.workspaces.with(|workspace| {
                self.finish(before, seen, t * share, x, workspace);
                let prepared = &mut workspace.gathered.1;
                prepared.prepare(layer, self.feature(x));
                attention.key_value.apply(prepared, key_value);
                if looking == tokens {
                    attention.query.apply(prepared, query);
                }
            });
        });
        if looking < tokens {
            self.workspaces.with(|workspace| {
                let prepared = &mut workspace.gathered.1;
                prepared.prepare(layer, self.feature(&x[..looking * self.token()]));
                attention.query.apply(prepared, &mut queries[..looking * inner]);
            });
        }
    }

    /// What the heads of block `l` see for the first `looking` tokens.
    fn look(&self, l: usize, buffers: &mut Buffers, looking: usize, workers: usize) {
        let Buffers { x, query, key_value, seen } = buffers;
        let attention = &self.blocks[l].attention;
        let inner = self.coordinates * attention.query.width();
        let (query, key_value) =
            (&query[..looking * inner], &key_value[..x.len() / self.token() * 2 * inner]);
        seen.resize(attention.heads * looking * attention.seen_width(), 0.0);
        let heads = seen.chunks_mut(looking * attention.seen_width()).enumerate();
        for_each(workers, heads.collect(), |(h, seen)| {
            self.heads.with(|workspace| attention.look(h, query, key_value, seen, workspace));
        });
    }

    /// What follows the heads in a block, for the tokens `x`, the first of which is token `first`.
    fn finish(
        &self,
        block: Option<&Block>,
        seen: &[f32],
        first: usize,
        x: &mut [f32],
        workspace: &mut Workspace,
    ) {
        let Some(Block { attention, norm1, feed_forward, norm2 }) = block else { return };
        let (channels, coordinates) = (self.channels, self.coordinates);
        let Workspace { gathered, branch, lengths, feed_forward: workspace } = workspace;
        let y = grown(branch, x.len());
        attention.gather(seen, first, y, gathered);
        AddNormalised { x, y, gamma: norm1, channels, coordinates, lengths }.run();
        feed_forward.apply(self.feature(x), y, workspace);
        AddNormalised { x, y, gamma: norm2, channels, coordinates, lengths }.run();
    }

    fn feature<'a>(&self, data: &'a [f32]) -> Feature<'a> {
        let (coordinates, channels) = (self.coordinates, self.channels);
        Feature { data, coordinates, channels, width: padded(channels) }
    }
}

/// Tokens of one task.
fn share(tokens: usize, workers: usize) -> usize {
    tokens.div_ceil(workers).min(TOKENS)
}
