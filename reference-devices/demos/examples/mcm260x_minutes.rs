//! Prints `reference-devices/mcm260x/minutes.svg`: ten minutes of a packaging machine as a picture.
//!
//! `cargo run -p demos --example mcm260x_minutes > minutes.svg`, then it goes to
//! `reference-devices/mcm260x/`.

mod drawing;

use std::error::Error;
use std::ops::Range;

use demos::mcm260x::{self, Sample};
use drawing::{Area, LABELS, Outcome, TEXT};
use plotters::prelude::*;
use reference_devices::devices;

fn main() -> Outcome {
    print!("{}", svg()?);
    Ok(())
}

fn svg() -> Result<String, Box<dyn Error>> {
    let device = devices::device("mcm260x-9ad").ok_or("there is no mcm260x-9ad")?;
    let samples = mcm260x::run(&device);
    drawing::svg("mcm260x_minutes", (1000, 730), |root| draw(&samples, root))
}

fn draw(samples: &[Sample], root: &Area) -> Outcome {
    let (upper, rest) = root.split_vertically(210);
    let (middle, rest) = rest.split_vertically(150);
    let (lower, lanes) = rest.split_vertically(150);
    let film: Curve = (|sample| f64::from(sample.per_second) / 1000.0, RGBColor(0x15, 0x65, 0xC0));
    draw_curve(samples, &upper, 34, (0.0..90.0, "kHz"), film)?;
    let jaw: Curve = (|sample| sample.celsius, RGBColor(0xC6, 0x28, 0x28));
    draw_curve(samples, &middle, 14, (0.0..200.0, "°C"), jaw)?;
    let drive: Curve = (|sample| sample.volts, RGBColor(0xE6, 0x9F, 0x00));
    draw_curve(samples, &lower, 14, (0.0..11.0, "V"), drive)?;
    drawing::lanes(&lanes, MINUTES, 11, &LANES.map(|lane| spans(samples, lane)))?;
    drawing::title(root, "Ten minutes of a packaging machine with the MCM260X-9AD")?;
    for (name, top) in [("edges of the film's encoder", 44), ("jaw", 226), ("drive", 376)] {
        let style = ("sans-serif", 13, &TEXT).into_text_style(root);
        root.draw_text(name, &style, (LABELS as i32 + 8, top))?;
    }
    Ok(())
}

/// What a chart shows, and its colour.
type Curve = (fn(&Sample) -> f64, RGBColor);

fn draw_curve(
    samples: &[Sample],
    area: &Area,
    margin_top: u32,
    (range, unit): (Range<f64>, &str),
    (value, colour): Curve,
) -> Outcome {
    let mut chart = drawing::panel(area, margin_top, MINUTES, range, (5, unit))?;
    let points = samples.iter().step_by(4).map(|sample| (minutes(sample), value(sample)));
    chart.draw_series(LineSeries::new(points, colour.stroke_width(2)))?;
    Ok(())
}

/// What a lane shows, and its colour.
type Lane = (&'static str, fn(&Sample) -> bool, RGBColor);

const LANES: [Lane; 5] = [
    ("door open", Sample::door, RGBColor(0x5D, 0x40, 0x37)),
    ("heating", Sample::heats, RGBColor(0xC6, 0x28, 0x28)),
    ("jaw closed", Sample::jaw, RGBColor(0x2E, 0x7D, 0x32)),
    ("knife", Sample::knife, RGBColor(0x94, 0x67, 0xBD)),
    ("product seen", Sample::product, RGBColor(0x00, 0x83, 0x8F)),
];

/// From when to when, in minutes. What comes and goes within a few seconds is one span, since the
/// picture could not show it.
fn spans(samples: &[Sample], (name, holds, colour): Lane) -> drawing::Lane {
    let mut spans: Vec<(f64, f64)> = Vec::new();
    for sample in samples.iter().filter(|sample| holds(sample)) {
        let from = minutes(sample);
        match spans.last_mut().filter(|(_, to)| from - *to < 3.0 / 60.0) {
            Some((_, to)) => *to = from + 0.25 / 60.0,
            None => spans.push((from, from + 0.25 / 60.0)),
        }
    }
    drawing::Lane { name, spans, colour }
}

fn minutes(sample: &Sample) -> f64 {
    sample.seconds / 60.0
}

const MINUTES: f64 = 10.0;

#[cfg(test)]
mod tests {
    #[test]
    fn the_picture_is_fresh() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../mcm260x/minutes.svg");
        let committed = std::fs::read_to_string(path).unwrap_or_default();
        let how = "the command that makes it stands at the top of examples/mcm260x_minutes.rs";
        assert!(committed == super::svg().unwrap(), "{path} is stale: {how}");
    }
}
