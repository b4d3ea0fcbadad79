//! The transformer over the tokens of one image.

use veni_core::model::EncoderConfig;

use super::attention::{self, Attention};
use super::feed_forward::{self, FeedForward};
use super::linear::{Feature, Prepared};
use super::matrix::padded;
use super::norm::AddNormalised;
use super::parallel::for_each;
use super::room::{Pool, grown};
use super::weights::{Shapes, Tensors};

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
    rooms: Pool<Room>,
    heads: Pool<attention::Room>,
}

/// Room for a block of tokens.
#[derive(Debug, Default)]
struct Room {
    gathered: (Vec<f32>, Prepared),
    branch: Vec<f32>,
    lengths: Vec<f32>,
    feed_forward: feed_forward::Room,
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
            rooms: Pool::default(),
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
        let Buffers { x, query, key_value, seen } = buffers;
        let tokens = x.len() / self.token();
        let share = tokens.div_ceil(workers).min(TOKENS);
        for l in 0..=self.blocks.len() {
            // the rest of the block before, and queries, keys and values of this one
            let before = l.checked_sub(1).map(|l| &self.blocks[l].attention).map(|a| (a, &*seen));
            let looking = if first_only && l == self.blocks.len() { 1 } else { tokens };
            let Some(block) = self.blocks.get(l) else {
                let x = &mut x[..looking * self.token()];
                let tasks = x.chunks_mut(share * self.token()).enumerate().collect();
                for_each(workers, tasks, |(t, x)| {
                    self.rooms.with(|room| self.finish(l, before, t * share, x, room));
                });
                return;
            };
            let looks_later = first_only && l + 1 == self.blocks.len();
            let attention = &block.attention;
            let inner = self.coordinates * attention.query.width();
            let queries = grown(query, tokens * inner);
            let key_values = grown(key_value, tokens * 2 * inner);
            let tasks = x.chunks_mut(share * self.token());
            let tasks =
                tasks.zip(queries.chunks_mut(share * inner)).zip(key_values.chunks_mut(share * 2 * inner));
            for_each(workers, tasks.enumerate().collect(), |(t, ((x, query), key_value))| {
                self.rooms.with(|room| {
                    self.finish(l, before, t * share, x, room);
                    let prepared = &mut room.gathered.1;
                    prepared.prepare(attention.query.layer(), self.feature(x));
                    attention.key_value.apply(prepared, key_value);
                    if !looks_later {
                        attention.query.apply(prepared, query);
                    }
                });
            });
            let looking = if looks_later { 1 } else { tokens };
            if looks_later {
                self.rooms.with(|room| {
                    let prepared = &mut room.gathered.1;
                    prepared.prepare(attention.query.layer(), self.feature(&x[..self.token()]));
                    attention.query.apply(prepared, &mut queries[..inner]);
                });
            }
            let queries = &queries[..looking * inner];
            seen.resize(attention.heads * looking * attention.seen_width(), 0.0);
            let heads = seen.chunks_mut(looking * attention.seen_width()).enumerate().collect();
            for_each(workers, heads, |(h, seen)| {
                self.heads.with(|room| attention.look(h, queries, key_values, seen, room));
            });
        }
    }

    /// What follows the heads in the block before block `l`, for the tokens `x`, the first of which is token `first`.
    fn finish(
        &self,
        l: usize,
        before: Option<(&Attention, &Vec<f32>)>,
        first: usize,
        x: &mut [f32],
        room: &mut Room,
    ) {
        let Some((attention, seen)) = before else { return };
        let Block { norm1, feed_forward, norm2, .. } = &self.blocks[l - 1];
        let (channels, coordinates) = (self.channels, self.coordinates);
        let Room { gathered, branch, lengths, feed_forward: room } = room;
        let y = grown(branch, x.len());
        attention.gather(seen, first, y, gathered);
        AddNormalised { x, y, gamma: norm1, channels, coordinates, lengths }.run();
        feed_forward.apply(self.feature(x), y, room);
        AddNormalised { x, y, gamma: norm2, channels, coordinates, lengths }.run();
    }

    fn feature<'a>(&self, data: &'a [f32]) -> Feature<'a> {
        let (coordinates, channels) = (self.coordinates, self.channels);
        Feature { data, coordinates, channels, width: padded(channels) }
    }
}
