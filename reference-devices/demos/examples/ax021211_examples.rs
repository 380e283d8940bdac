//! Prints a worked example of the valve controller's manual as a picture: `joystick`, `engine` or
//! `mixing`.
//!
//! `cargo run -p demos --example ax021211_examples joystick >
//! reference-devices/ax021211/joystick.svg`, and likewise for the others.

use std::error::Error;
use std::ops::Range;

use demos::ax021211::{self, Sample};
use plotters::prelude::*;
use reference_devices::devices;

#[expect(dead_code, reason = "the lanes of the other pictures")]
mod drawing;

use drawing::{AXIS, Area, GRID, LABELS, Outcome, TEXT};

fn main() -> Outcome {
    let name = std::env::args().nth(1).unwrap_or_default();
    print!("{}", svg(&name)?);
    Ok(())
}

fn svg(name: &str) -> Result<String, Box<dyn Error>> {
    let device = devices::device("ax021211").ok_or("there is no ax021211")?;
    let draw: fn(&[Sample], &Area) -> Outcome = match name {
        "joystick" => draw_joystick,
        "engine" => draw_engine,
        "mixing" => draw_mixing,
        _ => return Err("which of joystick, engine and mixing?".into()),
    };
    let samples = match name {
        "joystick" => ax021211::joystick(&device),
        "engine" => ax021211::engine(&device),
        _ => ax021211::mixing(&device),
    };
    drawing::svg("ax021211_examples", (900, 420), |root| draw(&samples, root))
}

fn draw_joystick(samples: &[Sample], area: &Area) -> Outcome {
    drawing::title(area, "A joystick with a dead-band of 500 mV (figure 11)")?;
    let axis =
        Axis { range: 0.0..5000.0, label: "joystick in mV", with: |sample, _| sample.joystick };
    let curves: [Curve; 2] = [
        ("output 1, profile B", |sample| sample.currents[0], RED),
        ("output 2, profile A", |sample| sample.currents[1], VIOLET),
    ];
    chart(samples, area, 34, (axis, 0.0..1600.0, "mA"), &curves)
}

fn draw_engine(samples: &[Sample], area: &Area) -> Outcome {
    let (upper, lower) = area.split_vertically(200);
    drawing::title(&upper, "Below 1000 1/min the joystick has another table (1.6)")?;
    let speed: [Curve; 1] = [("engine speed", |sample| sample.other, VIOLET)];
    chart(samples, &upper, 34, (time(), 0.0..2400.0, ""), &speed)?;
    let current: [Curve; 1] = [("output 1, joystick at 4 V", |sample| sample.currents[0], RED)];
    chart(samples, &lower, 14, (time(), 0.0..1600.0, "mA"), &current)
}

fn draw_mixing(samples: &[Sample], area: &Area) -> Outcome {
    let (upper, lower) = area.split_vertically(200);
    drawing::title(&upper, "Three quarters joystick, one quarter potentiometer (1.7)")?;
    let inputs: [Curve; 2] = [
        ("joystick", |sample| sample.joystick / 50.0, ORANGE),
        ("potentiometer", |sample| sample.other, VIOLET),
    ];
    chart(samples, &upper, 34, (time(), 0.0..110.0, "%"), &inputs)?;
    let current: [Curve; 1] = [("output 1", |sample| sample.currents[0], RED)];
    chart(samples, &lower, 14, (time(), 0.0..1600.0, "mA"), &current)
}

/// What a chart shows, how it gets it from a sample, and its colour.
type Curve = (&'static str, fn(&Sample) -> f64, RGBColor);

/// The horizontal axis: a value of each sample, counted from 0.
struct Axis {
    range: Range<f64>,
    label: &'static str,
    with: fn(&Sample, usize) -> f64,
}

/// A sample every 25 ms.
fn time() -> Axis {
    Axis { range: 0.0..5.0, label: "seconds", with: |_, place| place as f64 * 0.025 }
}

fn chart(
    samples: &[Sample],
    area: &Area,
    margin_top: u32,
    (axis, range, unit): (Axis, Range<f64>, &str),
    curves: &[Curve],
) -> Outcome {
    let mut chart = ChartBuilder::on(area)
        .margin_top(margin_top)
        .margin_right(24)
        .set_label_area_size(LabelAreaPosition::Left, LABELS)
        .set_label_area_size(LabelAreaPosition::Bottom, 40)
        .build_cartesian_2d(axis.range, range)?;
    chart
        .configure_mesh()
        .disable_x_mesh()
        .y_labels(6)
        .x_label_formatter(&|value| format!("{value:.0}"))
        .y_label_formatter(&|value| format!("{value:.0} {unit}"))
        .x_desc(axis.label)
        .bold_line_style(GRID)
        .light_line_style(TRANSPARENT)
        .axis_style(AXIS)
        .label_style(("sans-serif", 13, &TEXT))
        .draw()?;
    for (name, value, colour) in curves {
        let points = samples.iter().enumerate();
        let points = points.map(|(place, sample)| ((axis.with)(sample, place), value(sample)));
        let colour = *colour;
        chart
            .draw_series(LineSeries::new(points, colour.stroke_width(2)))?
            .label(*name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 22, y)], colour.stroke_width(3)));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperMiddle)
        .background_style(WHITE)
        .border_style(GRID)
        .label_font(("sans-serif", 13, &TEXT))
        .draw()?;
    Ok(())
}

const RED: RGBColor = RGBColor(0xC6, 0x28, 0x28);
const VIOLET: RGBColor = RGBColor(0x94, 0x67, 0xBD);
const ORANGE: RGBColor = RGBColor(0xE6, 0x9F, 0x00);

#[cfg(test)]
mod tests {
    #[test]
    fn the_pictures_are_fresh() {
        for name in ["joystick", "engine", "mixing"] {
            let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../ax021211");
            let path = format!("{folder}/{name}.svg");
            let committed = std::fs::read_to_string(&path).unwrap_or_default();
            let how =
                "the command that makes it stands at the top of examples/ax021211_examples.rs";
            assert!(committed == super::svg(name).unwrap(), "{path} is stale: {how}");
        }
    }
}
