use super::*;
use crate::protocol::light::Sun;
use veni_light::light::CompactLight;

const GRID: Equirect = Equirect { width: 256, height: 128 };

/// Log radiance of a sky over ground with a sun at this azimuth, degrees, 37° high.
fn sunny(azimuth: f32) -> Vec<f32> {
    let below = |d: &[f32; 3]| if d[2] < 0.0 { [0.2; 3] } else { [0.5, 0.7, 1.0] };
    let mut pixels: Vec<_> = GRID.directions().iter().map(below).collect();
    let (sin, cos) = azimuth.to_radians().sin_cos();
    CompactLight::new([0.8 * cos, 0.8 * sin, 0.6], [8.0; 3], CompactLight::SUN_RADIUS)
        .add_to(GRID, &mut pixels);
    pixels.into_flattened().into_iter().map(f32::ln).collect()
}

#[test]
fn only_the_known_white_says_how_bright_the_light_is() {
    let (judge, truth) = (Judge::new(GRID), sunny(20.0));
    let balls = judge.balls(&truth);
    let half: Vec<f32> = truth.iter().map(|v| v - 2f32.ln()).collect();
    let judged = |white| judge.judge(&half, white, &truth, &balls).unwrap();
    let (unknown, known) = (judged(1.0), judged(2.0));
    assert!((unknown.lit.error - 2f64.ln()).abs() < 1e-5 && known.lit.error < 1e-5, "{:?}", unknown.lit);
    for judged in [unknown, known] {
        let Sun::Both { degrees, irradiance } = judged.lit.sun else { panic!("{:?}", judged.lit) };
        assert!(judged.lit.aligned < 1e-5 && degrees < 1e-3 && irradiance < 1e-4, "{:?}", judged.lit);
        assert!(judged.balls.iter().flatten().all(|e| *e < 1e-3), "{:?}", judged.balls);
    }
    // on the other side: to a pixel
    let moved = judge.judge(&sunny(200.0), 1.0, &truth, &balls).unwrap();
    assert!(moved.lit.aligned > 0.5 && moved.balls[0][0] > 0.1, "{:?} {:?}", moved.lit, moved.balls);
    assert!(
        matches!(moved.lit.sun, Sun::Both { degrees, .. } if (degrees - 106.26).abs() < 1.4),
        "{:?}",
        moved.lit
    );
}

#[test]
fn suns_are_in_sight_or_not() {
    // 37° is above what the camera sees, 26°
    assert_eq!(sun_place(GRID, &sunny(0.0)).unwrap(), "out of sight");
    let mut low: Vec<_> = GRID.directions().iter().map(|_| [0.5f32; 3]).collect();
    CompactLight::new([0.98, 0.0, 0.2], [8.0; 3], CompactLight::SUN_RADIUS).add_to(GRID, &mut low);
    let low: Vec<f32> = low.into_flattened().into_iter().map(f32::ln).collect();
    assert_eq!(sun_place(GRID, &low).unwrap(), "in sight");
    let behind = turned(GRID, &low, std::f64::consts::PI);
    assert_eq!(sun_place(GRID, &behind).unwrap(), "out of sight");
    assert_eq!(sun_place(GRID, &vec![0.0; 3 * GRID.len()]).unwrap(), "not there");
}

#[test]
fn a_photograph_is_in_the_middle_of_its_cell() {
    let [width, height] = camera::SIZE;
    let values: Vec<_> = (0..width * height).map(|p| [(p % width) as u8, (p / width) as u8, 0]).collect();
    let framed = framed(Equirect::new(128, 64), &values);
    let at = |column: usize, row: usize| framed[row * 128 + column];
    // 85 columns from the 22nd on
    assert_eq!([at(20, 5), at(106, 5)], [[255; 3]; 2]);
    assert_eq!([at(21, 0), at(105, 63)], [[0, 0, 0], [94, 70, 0]]);
}
