//! Prints `reference-devices/em66/hour.svg`: an hour with the heating/cooling device as a picture.
//!
//! `cargo run -p reference-devices --example em66_hour > reference-devices/em66/hour.svg`

mod drawing;

use std::error::Error;

use drawing::{Area, GRID, Outcome, TEXT, panel};
use plotters::prelude::*;
use reference_devices::devices;
use reference_devices::devices::em66::hour::{self, Sample};

fn main() -> Outcome {
    print!("{}", svg()?);
    Ok(())
}

fn svg() -> Result<String, Box<dyn Error>> {
    let device = devices::device("em66").ok_or("there is no em66")?;
    let hour = hour::run(&device);
    drawing::svg("em66_hour", (1000, 690), |root| draw(&hour, root))
}

fn draw(hour: &[Sample], root: &Area) -> Outcome {
    let (upper, lanes) = root.split_vertically(470);
    let (temperatures, output) = upper.split_vertically(310);
    draw_temperatures(hour, &temperatures)?;
    draw_output(hour, &output)?;
    drawing::lanes(&lanes, MINUTES, 13, &LANES.map(|lane| spans(hour, lane)))
}

/// What a line of the upper chart shows, its colour and its width.
type Curve = (&'static str, fn(&Sample) -> i16, RGBColor, u32);

const CURVES: [Curve; 4] = [
    ("set point", |sample| sample.set_point, RGBColor(0xB0, 0xBE, 0xC5), 5),
    ("mould", |sample| sample.mould, RGBColor(0x94, 0x67, 0xBD), 2),
    ("return line", |sample| sample.return_line, RGBColor(0xE6, 0x9F, 0x00), 2),
    ("main line", |sample| sample.effective, RGBColor(0xC6, 0x28, 0x28), 2),
];

fn draw_temperatures(hour: &[Sample], area: &Area) -> Outcome {
    let mut chart = panel(area, 34, MINUTES, 20.0..90.0, (7, "°C"))?;
    for (name, value, colour, width) in CURVES {
        let points = hour.iter().step_by(4);
        let points = points.map(|sample| (minutes(sample), f64::from(value(sample)) / 10.0));
        chart.draw_series(LineSeries::new(points, colour.stroke_width(width)))?.label(name).legend(
            move |(x, y)| PathElement::new([(x, y), (x + 22, y)], colour.stroke_width(width + 1)),
        );
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::Coordinate(330, 176))
        .background_style(WHITE)
        .border_style(GRID)
        .label_font(("sans-serif", 13, &TEXT))
        .draw()?;
    drawing::title(area, "An hour with the EUROMAP 66 heating/cooling device")
}

fn draw_output(hour: &[Sample], area: &Area) -> Outcome {
    let mut chart = panel(area, 14, MINUTES, -100.0..100.0, (5, "%"))?;
    for (side, colour) in [(1.0, HEAT), (-1.0, COLD)] {
        let share = |sample: &Sample| (f64::from(sample.output) / 10.0 * side).max(0.0) * side;
        let points = hour.iter().map(|sample| (minutes(sample), share(sample)));
        let area = AreaSeries::new(points, 0.0, colour.mix(0.35)).border_style(colour);
        chart.draw_series(area)?;
    }
    for (name, at, colour) in [("heating", 92.0, HEAT), ("cooling", -62.0, COLD)] {
        let style = ("sans-serif", 13, &colour).into_text_style(area);
        chart.draw_series([Text::new(name, (0.4, at), style)])?;
    }
    Ok(())
}

/// What a lane shows, and its colour.
type Lane = (&'static str, fn(&Sample) -> bool, RGBColor);

const LANES: [Lane; 7] = [
    ("controller on", Sample::on, RGBColor(0x2E, 0x7D, 0x32)),
    ("self-optimisation", Sample::optimises, RGBColor(0x00, 0x83, 0x8F)),
    ("second set point", Sample::second_set_point, RGBColor(0x94, 0x67, 0xBD)),
    ("alarm on the flow", Sample::alarm, RGBColor(0xC6, 0x28, 0x28)),
    ("suction", Sample::suction, RGBColor(0xE6, 0x9F, 0x00)),
    ("cooling down", Sample::cools_down, COLD),
    ("evacuating", Sample::evacuates, RGBColor(0x5D, 0x40, 0x37)),
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
const COLD: RGBColor = RGBColor(0x15, 0x65, 0xC0);

#[cfg(test)]
mod tests {
    #[test]
    fn the_picture_is_fresh() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/em66/hour.svg");
        let committed = std::fs::read_to_string(path).unwrap_or_default();
        let how = "the command that makes it stands at the top of examples/em66_hour.rs";
        assert!(committed == super::svg().unwrap(), "{path} is stale: {how}");
    }
}
