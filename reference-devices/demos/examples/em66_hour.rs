//! Prints `reference-devices/em66/hour.svg`: an hour with the heating/cooling device as a picture.
//!
//! `cargo run -p demos --example em66_hour > reference-devices/em66/hour.svg`

mod drawing;
mod hours;

use std::error::Error;

use demos::em66::{self, Sample};
use drawing::{Area, Outcome, panel};
use hours::{Curve, Shown};
use plotters::prelude::*;
use reference_devices::devices;

fn main() -> Outcome {
    print!("{}", svg()?);
    Ok(())
}

fn svg() -> Result<String, Box<dyn Error>> {
    let device = devices::device("em66").ok_or("there is no em66")?;
    let hour = em66::run(&device);
    drawing::svg("em66_hour", (1000, 690), |root| draw(&hour, root))
}

fn draw(hour: &[Sample], root: &Area) -> Outcome {
    let (upper, lanes) = root.split_vertically(470);
    let (temperatures, output) = upper.split_vertically(310);
    draw_temperatures(hour, &temperatures)?;
    draw_output(hour, &output)?;
    drawing::lanes(&lanes, MINUTES, 13, &LANES.map(|lane| hours::lane(hour, minutes, lane)))
}

const CURVES: [Curve<Sample>; 4] = [
    ("set point", |sample| f64::from(sample.set_point) / 10.0, RGBColor(0xB0, 0xBE, 0xC5), 5),
    ("mould", |sample| f64::from(sample.mould) / 10.0, RGBColor(0x94, 0x67, 0xBD), 2),
    ("return line", |sample| f64::from(sample.return_line) / 10.0, RGBColor(0xE6, 0x9F, 0x00), 2),
    ("main line", |sample| f64::from(sample.effective) / 10.0, RGBColor(0xC6, 0x28, 0x28), 2),
];

fn draw_temperatures(hour: &[Sample], area: &Area) -> Outcome {
    let mut chart = panel(area, 34, MINUTES, 20.0..90.0, (7, "°C"))?;
    let samples = hour.iter().step_by(4);
    hours::curves(
        &mut chart,
        samples,
        minutes,
        &CURVES,
        SeriesLabelPosition::Coordinate(330, 176),
    )?;
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

const LANES: [Shown<Sample>; 7] = [
    ("controller on", Sample::on, RGBColor(0x2E, 0x7D, 0x32)),
    ("self-optimisation", Sample::optimises, RGBColor(0x00, 0x83, 0x8F)),
    ("second set point", Sample::second_set_point, RGBColor(0x94, 0x67, 0xBD)),
    ("alarm on the flow", Sample::alarm, RGBColor(0xC6, 0x28, 0x28)),
    ("suction", Sample::suction, RGBColor(0xE6, 0x9F, 0x00)),
    ("cooling down", Sample::cools_down, COLD),
    ("evacuating", Sample::evacuates, RGBColor(0x5D, 0x40, 0x37)),
];

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
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../em66/hour.svg");
        let committed = std::fs::read_to_string(path).unwrap_or_default();
        let how = "the command that makes it stands at the top of examples/em66_hour.rs";
        assert!(committed == super::svg().unwrap(), "{path} is stale: {how}");
    }
}
