//! Curves and scatter plots with axes.

use embedded_graphics::pixelcolor::Rgb888;
use embedded_graphics::prelude::{Point, Primitive, Size};
use embedded_graphics::primitives::{Circle, Line, PrimitiveStyle, Rectangle};
use embedded_graphics::text::Alignment;

use super::canvas::Canvas;

const WIDTH: i32 = 640;
const HEIGHT: i32 = 420;
/// Left, right, top and bottom of the frame.
const FRAME: [i32; 4] = [78, 620, 34, 370];
/// Colours that stay apart for colour-blind eyes (Okabe and Ito), as [r, g, b].
const COLOURS: [[u8; 3]; 7] =
    [[0, 114, 178], [213, 94, 0], [0, 158, 115], [204, 121, 167], [230, 159, 0], [86, 180, 233], [0, 0, 0]];

/// What an axis says and how it is divided.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Axis {
    /// Quantity and unit.
    pub title: String,
    /// Whether equal ratios are equally long.
    pub logarithmic: bool,
}

/// Points of one name and colour.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Its name in the legend.
    pub name: String,
    /// (x, y); what is not finite, or not positive on a logarithmic axis, is left out.
    pub points: Vec<[f64; 2]>,
    /// Whether the points are joined in their order; else they are dots.
    pub joined: bool,
}

/// A plot.
#[derive(Clone, Debug, PartialEq)]
pub struct Plot {
    /// Above the frame.
    pub title: String,
    /// Horizontal and vertical axis.
    pub axes: [Axis; 2],
    /// The data.
    pub series: Vec<Series>,
}

impl Axis {
    /// An axis with equal differences.
    pub fn linear(title: &str) -> Self {
        Self { title: title.to_owned(), logarithmic: false }
    }

    /// An axis with equal ratios.
    pub fn logarithmic(title: &str) -> Self {
        Self { title: title.to_owned(), logarithmic: true }
    }

    fn value(&self, v: f64) -> Option<f64> {
        let v = if self.logarithmic { v.log10() } else { v };
        v.is_finite().then_some(v)
    }
}

impl Plot {
    /// Draws it on a canvas of its own.
    pub fn draw(&self) -> Canvas {
        let mut canvas = Canvas::new(WIDTH as usize, HEIGHT as usize);
        let [left, right, top, bottom] = FRAME;
        canvas.text(&self.title, [(left + right) / 2, 14], Alignment::Center);
        canvas.text(&self.axes[0].title, [(left + right) / 2, bottom + 36], Alignment::Center);
        canvas.text(&self.axes[1].title, [6, top - 8], Alignment::Left);
        let ranges = [0, 1].map(|k| self.range(k));
        let along = |v: f64, [low, high]: [f64; 2], length: i32| {
            ((v - low) / (high - low) * f64::from(length)).round() as i32
        };
        let to_x = |v: f64, range| left + along(v, range, right - left);
        let to_y = |v: f64, range| bottom - along(v, range, bottom - top);
        for (k, range) in ranges.iter().enumerate() {
            for (value, label) in ticks(*range, self.axes[k].logarithmic) {
                if k == 0 {
                    let x = to_x(value, *range);
                    line(&mut canvas, [x, top], [x, bottom], [230; 3], 1);
                    canvas.text(&label, [x, bottom + 14], Alignment::Center);
                } else {
                    let y = to_y(value, *range);
                    line(&mut canvas, [left, y], [right, y], [230; 3], 1);
                    canvas.text(&label, [left - 6, y], Alignment::Right);
                }
            }
        }
        let size = Size::new((right - left + 1) as u32, (bottom - top + 1) as u32);
        let border = PrimitiveStyle::with_stroke(colour([0; 3]), 1);
        canvas.draw(&Rectangle::new(Point::new(left, top), size).into_styled(border));
        for (at, series) in self.series.iter().enumerate() {
            let paint = COLOURS[at % COLOURS.len()];
            let place = |p: &[f64; 2]| {
                let (x, y) = (self.axes[0].value(p[0])?, self.axes[1].value(p[1])?);
                Some([to_x(x, ranges[0]), to_y(y, ranges[1])])
            };
            let places: Vec<_> = series.points.iter().filter_map(place).collect();
            if series.joined {
                places.windows(2).for_each(|pair| line(&mut canvas, pair[0], pair[1], paint, 2));
            }
            for [x, y] in places {
                let dot = if series.joined { 5 } else { 3 };
                let style = PrimitiveStyle::with_fill(colour(paint));
                canvas.draw(&Circle::with_center(Point::new(x, y), dot).into_styled(style));
            }
            let y = top + 12 + 13 * at as i32;
            line(&mut canvas, [left + 8, y], [left + 24, y], paint, 3);
            canvas.text(&series.name, [left + 30, y], Alignment::Left);
        }
        canvas
    }

    /// The range of an axis (in its own measure): the data's with a margin.
    fn range(&self, k: usize) -> [f64; 2] {
        let points = self.series.iter().flat_map(|s| &s.points);
        let values = points.filter_map(|p| self.axes[k].value(p[k]));
        let (low, high) = values.fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
        if low > high {
            return [0.0, 1.0];
        }
        let margin = if high > low { 0.05 * (high - low) } else { 0.5 * high.abs().max(1e-3) };
        [low - margin, high + margin]
    }
}

/// Places (in the axis's measure) and labels of about five ticks.
fn ticks([low, high]: [f64; 2], logarithmic: bool) -> Vec<(f64, String)> {
    let raw = (high - low) / 5.0;
    let power = 10f64.powf(raw.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|m| m * power).into_iter().find(|s| *s >= raw).unwrap_or(raw);
    let step = if logarithmic && step > 0.5 { step.ceil() } else { step };
    let first = (low / step).ceil() as i64;
    let count = ((high - first as f64 * step) / step).floor() as i64;
    (first..=first + count)
        .map(|k| {
            let at = k as f64 * step;
            (at, label(if logarithmic { 10f64.powf(at) } else { at }))
        })
        .collect()
}

/// At most four significant digits.
fn label(value: f64) -> String {
    let size = value.abs();
    if size < 1e-12 {
        "0".to_owned()
    } else if !(1e-3..1e5).contains(&size) {
        format!("{value:.1e}")
    } else {
        let digits = (3.0 - size.log10().floor()).clamp(0.0, 6.0) as usize;
        let text = format!("{value:.digits$}");
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
    }
}

fn line(canvas: &mut Canvas, [x, y]: [i32; 2], [u, v]: [i32; 2], paint: [u8; 3], width: u32) {
    let style = PrimitiveStyle::with_stroke(colour(paint), width);
    canvas.draw(&Line::new(Point::new(x, y), Point::new(u, v)).into_styled(style));
}

fn colour([r, g, b]: [u8; 3]) -> Rgb888 {
    Rgb888::new(r, g, b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        let labels =
            |range, logarithmic| ticks(range, logarithmic).into_iter().map(|t| t.1).collect::<Vec<_>>();
        assert_eq!(labels([0.0, 10.0], false), ["0", "2", "4", "6", "8", "10"]);
        assert_eq!(labels([-0.11, 0.11], false), ["-0.1", "-0.05", "0", "0.05", "0.1"]);
        assert_eq!(labels([-2.2, 2.1], true), ["0.01", "0.1", "1", "10", "100"]);
        assert!(!labels([3.0, 3.1], false).is_empty());
    }

    #[test]
    fn points_lie_where_their_values_say() {
        let series = |points, joined| Series { name: "s".into(), points, joined };
        let axes = [Axis::linear("x"), Axis::logarithmic("y")];
        let points = vec![[0.0, 1.0], [1.0, 100.0], [0.5, f64::NAN], [0.5, -1.0]];
        let plot = Plot { title: "t".into(), axes, series: vec![series(points, false)] };
        let canvas = plot.draw();
        let at = |x: f64, y: f64| {
            let [left, right, top, bottom] = FRAME.map(f64::from);
            let (u, v) = ((x + 0.05) / 1.1, (y + 0.1) / 2.2);
            let place = [left + u * (right - left), bottom - v * (bottom - top)].map(|c| c.round() as usize);
            canvas.pixel(place[0], place[1])
        };
        assert_eq!(at(0.0, 0.0), COLOURS[0]);
        assert_eq!(at(1.0, 2.0), COLOURS[0]);
        assert_ne!(at(0.5, 1.0), COLOURS[0], "not joined");
        let empty = Plot { series: vec![series(vec![], true)], ..plot };
        assert!(empty.draw().pixels().contains(&[0; 3]));
    }
}
