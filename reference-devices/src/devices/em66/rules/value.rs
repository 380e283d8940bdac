//! The decisions of the process values (2.3, 3.4.9 to 3.4.15).

use canopen::Mux;

use super::Em66Rules;
use crate::devices::em66::objects::NO_SENSOR;

decisions! {
    /// The decisions of the process values (2.3, 3.4.9 to 3.4.15).
    pub(crate) ValueDecision of Em66Rules, otherwise [DEVIATIONS];

    /// A written value counts at once, not in the next cycle.
    fn evaluates_at_once(&self) -> bool {
        true
    }

    /// A value is what its sensor measures, in tenths (2.3).
    fn shown(&self, _of: Mux, tenths: i64) -> i64 {
        tenths
    }

    /// The values of the main line (3.4.9) and of the return line (3.4.10).
    fn lines(&self, main: i64, return_line: i64) -> (i64, i64) {
        (main, return_line)
    }

    /// 3030h is how far the lines are apart, whichever is warmer (3.4.11).
    fn difference(&self, main: i64, return_line: i64) -> i64 {
        (main - return_line).abs()
    }
}

deviations! {
    pub(super) DEVIATIONS of ValueDecision;

    "values-in-whole-units" => shown: |_, _, tenths| tenths / 10 * 10;
    "lines-in-hundredths" => shown: |_, of, tenths| {
        if matches!(of.index, 0x3010..=0x3030) { tenths * 10 } else { tenths }
    };
    "external-temperature-in-hundredths" => shown: |_, of, tenths| {
        if of.index == 0x3040 && tenths != NO_SENSOR { tenths * 10 } else { tenths }
    };
    "flow-in-hundredths" =>
        shown: |_, of, tenths| if of.index == 0x3050 { tenths * 10 } else { tenths };
    "pressure-in-hundredths" =>
        shown: |_, of, tenths| if of.index == 0x3080 { tenths * 10 } else { tenths };
    "lines-show-more" => lines: |_, main, return_line| (main + 4, return_line + 4);
    "main-line-stands-still" =>
        shown: |_, of, tenths| if of.index == 0x3010 { 200 } else { tenths };
    "external-temperature-stands-still" =>
        shown: |_, of, tenths| if of.index == 0x3040 { 200 } else { tenths };
    "flow-stands-still" => shown: |_, of, tenths| if of.index == 0x3050 { 0 } else { tenths };
    "flow-in-litres-an-hour" =>
        shown: |_, of, tenths| if of.index == 0x3050 { tenths * 6 } else { tenths };
    "pressure-in-millibar" =>
        shown: |_, of, tenths| if of.index == 0x3080 { tenths * 100 } else { tenths };
    "pressure-stands-still" => shown: |_, of, tenths| if of.index == 0x3080 { 10 } else { tenths };
    "flow-of-ten-bits" =>
        shown: |_, of, tenths| if of.index == 0x3050 { tenths & 0x3FF } else { tenths };
    "pressure-of-eight-bits" =>
        shown: |_, of, tenths| if of.index == 0x3080 { i64::from(tenths as i8) } else { tenths };
    "external-temperature-of-two-digits-below-zero" =>
        shown: |_, of, tenths| if of.index == 0x3040 { tenths.max(-99) } else { tenths };
    "difference-of-eight-bits" =>
        difference: |_, main, return_line| (main - return_line).abs() & 0xFF;
    "difference-ends-at-99-9" =>
        difference: |_, main, return_line| (main - return_line).abs().min(999);
    "lines-mixed-up" => lines: |_, main, return_line| (return_line, main);
    "return-line-is-guessed" => lines: |_, main, _| (main, main - 20);
    "difference-with-sign" => difference: |_, main, return_line| main - return_line;
    "difference-of-what-is-warmer-only" =>
        difference: |_, main, return_line| (main - return_line).max(0);
    "difference-in-whole-degrees" =>
        difference: |_, main, return_line| (main - return_line).abs() / 10 * 10;
    "difference-is-never-nothing" =>
        difference: |_, main, return_line| (main - return_line).abs().max(1);
}
