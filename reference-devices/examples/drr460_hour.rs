//! Prints `reference-devices/drr460/hour.svg`: an hour with the temperature controller.
//!
//! `cargo run -p reference-devices --example drr460_hour > hour.svg`, then it goes to
//! `reference-devices/drr460/`.

mod drawing;

use std::error::Error;

use drawing::{Area, GRID, Outcome, TEXT, panel};
use plotters::prelude::*;
use reference_devices::devices;
use reference_devices::devices::drr460::hour::{self, Sample};

fn main() -> Outcome {
    print!("{}", svg()?);
    Ok(())
}

fn svg() -> Result<String, Box<dyn Error>> {
    let device = devices::device("drr460").ok_or("there is no drr460")?;
    let hour = hour::run(&device);
    drawing::svg("drr460_hour", (1000, 610), |root| draw(&hour, root))
}

fn draw(hour: &[Sample], root: &Area) -> Outcome {
    let (upper, lanes) = root.split_vertically(450);
    let (temperatures, output) = upper.split_vertically(310);
    draw_temperatures(hour, &temperatures)?;
    draw_output(hour, &output)?;
    drawing::lanes(&lanes, MINUTES, 13, &LANES.map(|lane| spans(hour, lane)))
}

/// What a line of the upper chart shows, its colour and its width.
type Curve = (&'static str, fn(&Sample) -> i16, RGBColor, u32);

const CURVES: [Curve; 2] = [
    ("set point in force", |sample| sample.set_point, RGBColor(0xB0, 0xBE, 0xC5), 5),
    ("process", |sample| sample.process, RGBColor(0xC6, 0x28, 0x28), 2),
];

fn draw_temperatures(hour: &[Sample], area: &Area) -> Outcome {
    let mut chart = panel(area, 34, MINUTES, 0.0..200.0, (7, "°C"))?;
    for (name, value, colour, width) in CURVES {
        let points = hour.iter().step_by(2);
        let points = points.map(|sample| (minutes(sample), f64::from(value(sample)) / 10.0));
        chart.draw_series(LineSeries::new(points, colour.stroke_width(width)))?.label(name).legend(
            move |(x, y)| PathElement::new([(x, y), (x + 22, y)], colour.stroke_width(width + 1)),
        );
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .background_style(WHITE)
        .border_style(GRID)
        .label_font(("sans-serif", 13, &TEXT))
        .draw()?;
    drawing::title(area, "An hour with the temperature controller DRR460")
}

fn draw_output(hour: &[Sample], area: &Area) -> Outcome {
    let mut chart = panel(area, 14, MINUTES, 0.0..100.0, (5, "%"))?;
    let points = hour.iter().map(|sample| (minutes(sample), f64::from(sample.output) / 100.0));
    let area = AreaSeries::new(points, 0.0, HEAT.mix(0.35)).border_style(HEAT);
    chart.draw_series(area)?;
    Ok(())
}

/// What a lane shows, and its colour.
type Lane = (&'static str, fn(&Sample) -> bool, RGBColor);

const LANES: [Lane; 3] = [
    ("tuning", Sample::tunes, RGBColor(0x00, 0x83, 0x8F)),
    ("soft start", Sample::starts_softly, RGBColor(0x94, 0x67, 0xBD)),
    ("deviation alarm", Sample::alarm, HEAT),
];

/// From when to when, in minutes; what is short is made long enough to be seen.
fn spans(hour: &[Sample], (name, holds, colour): Lane) -> drawing::Lane {
    let pieces = hour.chunk_by(|one, next| holds(one) == holds(next));
    let spans = pieces.filter(|piece| piece.first().is_some_and(holds)).filter_map(|piece| {
        let (first, last) = (piece.first()?, piece.last()?);
        let from = minutes(first);
        Some((from, (minutes(last) + 2.0 / 60.0).max(from + 0.15)))
    });
    drawing::Lane { name, spans: spans.collect(), colour }
}

fn minutes(sample: &Sample) -> f64 {
    f64::from(sample.seconds) / 60.0
}

const MINUTES: f64 = 60.0;
const HEAT: RGBColor = RGBColor(0xC6, 0x28, 0x28);

#[cfg(test)]
mod tests {
    #[test]
    fn the_picture_is_fresh() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/drr460/hour.svg");
        let committed = std::fs::read_to_string(path).unwrap_or_default();
        let how = "the command that makes it stands at the top of examples/drr460_hour.rs";
        assert!(committed == super::svg().unwrap(), "{path} is stale: {how}");
    }
}
