//! What the pictures of an hour have in common: curves over the samples, and lanes below them.

use plotters::prelude::*;

use crate::drawing::{GRID, Lane, Outcome, Panel, TEXT};

/// A line of a chart: its name, value, colour and width.
pub(crate) type Curve<S> = (&'static str, fn(&S) -> f64, RGBColor, u32);

/// Lines over the samples, with their names at `place`.
pub(crate) fn curves<'s, S: 's>(
    chart: &mut Panel,
    samples: impl Iterator<Item = &'s S> + Clone,
    minutes: fn(&S) -> f64,
    curves: &[Curve<S>],
    place: SeriesLabelPosition,
) -> Outcome {
    for &(name, value, colour, width) in curves {
        let points = samples.clone().map(|sample| (minutes(sample), value(sample)));
        chart.draw_series(LineSeries::new(points, colour.stroke_width(width)))?.label(name).legend(
            move |(x, y)| PathElement::new([(x, y), (x + 22, y)], colour.stroke_width(width + 1)),
        );
    }
    chart
        .configure_series_labels()
        .position(place)
        .background_style(WHITE)
        .border_style(GRID)
        .label_font(("sans-serif", 13, &TEXT))
        .draw()?;
    Ok(())
}

/// What a lane shows, and its colour.
pub(crate) type Shown<S> = (&'static str, fn(&S) -> bool, RGBColor);

/// From when to when it holds, of samples two seconds apart; what is short is made long enough to
/// be seen.
pub(crate) fn lane<S>(
    samples: &[S],
    minutes: fn(&S) -> f64,
    (name, holds, colour): Shown<S>,
) -> Lane {
    let pieces = samples.chunk_by(|one, next| holds(one) == holds(next));
    let spans = pieces.filter(|piece| piece.first().is_some_and(holds)).filter_map(|piece| {
        let (first, last) = (piece.first()?, piece.last()?);
        let from = minutes(first);
        Some((from, (minutes(last) + 2.0 / 60.0).max(from + 0.15)))
    });
    Lane { name, spans: spans.collect(), colour }
}
