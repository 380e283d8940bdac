//! Prints `reference-devices/drr460/hour.svg`: an hour with the temperature controller.
//!
//! `cargo run -p demos --example drr460_hour > hour.svg`, then it goes to
//! `reference-devices/drr460/`.

mod drawing;
mod hours;

use std::error::Error;

use demos::drr460::{self, Sample};
use drawing::{Area, Outcome, panel};
use hours::{Curve, Shown};
use plotters::prelude::*;
use reference_devices::devices;

fn main() -> Outcome {
    print!("{}", svg()?);
    Ok(())
}

fn svg() -> Result<String, Box<dyn Error>> {
    let device = devices::device("drr460").ok_or("there is no drr460")?;
    let hour = drr460::run(&device);
    drawing::svg("drr460_hour", (1000, 610), |root| draw(&hour, root))
}

fn draw(hour: &[Sample], root: &Area) -> Outcome {
    let (upper, lanes) = root.split_vertically(450);
    let (temperatures, output) = upper.split_vertically(310);
    draw_temperatures(hour, &temperatures)?;
    draw_output(hour, &output)?;
    drawing::lanes(&lanes, MINUTES, 13, &LANES.map(|lane| hours::lane(hour, minutes, lane)))
}

const CURVES: [Curve<Sample>; 2] = [
    (
        "set point in force",
        |sample| f64::from(sample.set_point) / 10.0,
        RGBColor(0xB0, 0xBE, 0xC5),
        5,
    ),
    ("process", |sample| f64::from(sample.process) / 10.0, RGBColor(0xC6, 0x28, 0x28), 2),
];

fn draw_temperatures(hour: &[Sample], area: &Area) -> Outcome {
    let mut chart = panel(area, 34, MINUTES, 0.0..200.0, (7, "°C"))?;
    let samples = hour.iter().step_by(2);
    hours::curves(&mut chart, samples, minutes, &CURVES, SeriesLabelPosition::UpperRight)?;
    drawing::title(area, "An hour with the temperature controller DRR460")
}

fn draw_output(hour: &[Sample], area: &Area) -> Outcome {
    let mut chart = panel(area, 14, MINUTES, 0.0..100.0, (5, "%"))?;
    let points = hour.iter().map(|sample| (minutes(sample), f64::from(sample.output) / 100.0));
    let area = AreaSeries::new(points, 0.0, HEAT.mix(0.35)).border_style(HEAT);
    chart.draw_series(area)?;
    Ok(())
}

const LANES: [Shown<Sample>; 3] = [
    ("tuning", Sample::tunes, RGBColor(0x00, 0x83, 0x8F)),
    ("soft start", Sample::starts_softly, RGBColor(0x94, 0x67, 0xBD)),
    ("deviation alarm", Sample::alarm, HEAT),
];

fn minutes(sample: &Sample) -> f64 {
    f64::from(sample.seconds) / 60.0
}

const MINUTES: f64 = 60.0;
const HEAT: RGBColor = RGBColor(0xC6, 0x28, 0x28);

#[cfg(test)]
mod tests {
    #[test]
    fn the_picture_is_fresh() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../drr460/hour.svg");
        let committed = std::fs::read_to_string(path).unwrap_or_default();
        let how = "the command that makes it stands at the top of examples/drr460_hour.rs";
        assert!(committed == super::svg().unwrap(), "{path} is stale: {how}");
    }
}
