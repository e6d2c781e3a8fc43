//! What does a plot look like: axes, guides, lines, marks with bars of spread, as SVG?

use std::fmt::Write as _;

/// How numbers become places along an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Scale {
    /// Equal steps.
    Linear,
    /// Equal factors; zero and less lie on a strip of their own at the low end.
    Log,
}

/// One axis of a plot.
#[derive(Clone, Debug)]
pub(crate) struct PlotAxis {
    pub(crate) label: String,
    pub(crate) scale: Scale,
    /// Smallest and largest number shown.
    pub(crate) range: [f64; 2],
    /// What the strip for zero is called; none where zero does not occur.
    pub(crate) zero: Option<&'static str>,
}

/// One mark.
#[derive(Clone, Debug, Default)]
pub(crate) struct Mark {
    pub(crate) x: f64,
    pub(crate) y: f64,
    /// Spread along x, drawn as a bar.
    pub(crate) spread: Option<[f64; 2]>,
    /// Filled marks are on the front.
    pub(crate) is_solid: bool,
    /// What the pointer over it says.
    pub(crate) text: String,
    /// Index that the page finds more under.
    pub(crate) index: Option<usize>,
}

/// Marks of one kind, and the line through some of them.
#[derive(Clone, Debug, Default)]
pub(crate) struct Series {
    /// Class of the color: `c0`, `c1` ...
    pub(crate) color: usize,
    pub(crate) marks: Vec<Mark>,
    /// Places that a line goes through.
    pub(crate) line: Vec<[f64; 2]>,
    /// Class of the line: `front`, `best`, `thin`.
    pub(crate) line_class: &'static str,
}

/// A plot with a title.
#[derive(Clone, Debug)]
pub(crate) struct Plot {
    pub(crate) title: String,
    pub(crate) x: PlotAxis,
    pub(crate) y: PlotAxis,
    pub(crate) series: Vec<Series>,
    /// Upright lines with names.
    pub(crate) guides: Vec<(f64, String)>,
    /// Level lines with names.
    pub(crate) levels: Vec<(f64, String)>,
}

/// Where a plot lies in its picture, labels included.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    pub(crate) left: f64,
    pub(crate) top: f64,
    pub(crate) width: f64,
    pub(crate) height: f64,
}

/// Styles of every picture made here; dark where the reader's screen is.
pub(crate) const STYLE: &str = "\
svg{--paper:#fff;--ink:#1a1b1d;--soft:#5f6368;--grid:#e6e7e9;--edge:#b9bcc0}\
.c0{--c:#6b7280}.c1{--c:#2563d9}.c2{--c:#d9660f}.c3{--c:#128a55}.c4{--c:#9333c9}.c5{--c:#b0241c}.c6{--c:#0b8aa8}.c7{--c:#8a6d00}\
@media (prefers-color-scheme:dark){svg{--paper:#1d1e20;--ink:#e8e9ea;--soft:#a0a4aa;--grid:#2f3134;--edge:#55585d}\
.c0{--c:#a7adb8}.c1{--c:#6f9ff5}.c2{--c:#f0954d}.c3{--c:#4cc38a}.c4{--c:#c084ec}.c5{--c:#ff8d83}.c6{--c:#4fc3dd}.c7{--c:#d7b740}}\
text{font:12px system-ui,-apple-system,'Segoe UI',Roboto,'DejaVu Sans',sans-serif;fill:var(--ink)}\
.paper{fill:var(--paper)}.title{font-size:14px;font-weight:650}.soft{fill:var(--soft)}.small{font-size:11px}\
.grid{stroke:var(--grid);stroke-width:1}.edge{stroke:var(--edge);fill:none}.guide{stroke:var(--soft);stroke-dasharray:4 3}\
.strip{fill:var(--grid);opacity:.55}\
.front{fill:none;stroke:var(--c);stroke-width:2}.thin{fill:none;stroke:var(--c);stroke-width:1.2;opacity:.75}\
.best{fill:none;stroke:var(--ink);stroke-width:8;opacity:.12;stroke-linejoin:round;stroke-linecap:round}\
.bar{stroke:var(--c);stroke-width:1.2;opacity:.7}.mark{stroke:var(--c);stroke-width:1.4}\
.solid{fill:var(--c)}.hollow{fill:var(--paper);opacity:.75}.pt{cursor:pointer}.pt:hover .mark,.pt:focus .mark{stroke-width:4}";

/// Height of the strip for zero.
const STRIP: f64 = 18.0;

impl PlotAxis {
    /// Returns where a number lies between 0 and 1.
    fn at(&self, value: f64) -> f64 {
        let [low, high] = self.range;
        let share = match self.scale {
            Scale::Linear => (value - low) / (high - low),
            Scale::Log => (value.max(low) / low).ln() / (high / low).ln(),
        };
        if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.0 }
    }

    /// Lists the places of lines with their labels; empty labels have a line only.
    fn ticks(&self) -> Vec<(f64, String)> {
        let [low, high] = self.range;
        match self.scale {
            Scale::Linear => {
                let step = 10f64.powf((high - low).log10().floor());
                let step = [0.2, 0.5, 1.0, 2.0]
                    .into_iter()
                    .map(|s| s * step)
                    .find(|s| (high - low) / s <= 7.0)
                    .unwrap_or(high - low);
                let first = (low / step).ceil() as i64;
                let last = (high / step).floor() as i64;
                (first..=last).map(|i| (i as f64 * step, number(i as f64 * step))).collect()
            }
            Scale::Log => {
                let decades = (high / low).log10();
                let mut ticks = Vec::new();
                for power in (low.log10().floor() as i32)..=(high.log10().ceil() as i32) {
                    for factor in [1.0, 2.0, 5.0] {
                        let value = factor * 10f64.powi(power);
                        if value < low * 0.999 || value > high * 1.001 {
                            continue;
                        }
                        let every = if decades > 12.0 { 3 } else { 1 + i32::from(decades > 6.0) };
                        let labeled =
                            if factor == 1.0 { power.rem_euclid(every) == 0 } else { decades < 2.2 };
                        if factor == 1.0 || decades < 4.0 {
                            ticks.push((value, if labeled { number(value) } else { String::new() }));
                        }
                    }
                }
                ticks
            }
        }
    }
}

/// Writes a number for an axis or a table: three digits, powers of ten where it is far from one.
pub(crate) fn number(value: f64) -> String {
    let size = value.abs();
    if value == 0.0 {
        "0".to_owned()
    } else if !(1e-3..1e5).contains(&size) {
        let power = size.log10().floor();
        let digits = value / 10f64.powf(power);
        let power: String = format!("{power:.0}")
            .chars()
            .map(|c| match c {
                '-' => '⁻',
                _ => ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'][c as usize % 16 % 10],
            })
            .collect();
        if (digits - 1.0).abs() < 5e-3 { format!("10{power}") } else { format!("{digits:.2}·10{power}") }
    } else {
        let digits = (2 - size.log10().floor() as i32).clamp(0, 6) as usize;
        let text = format!("{value:.digits$}");
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
    }
}

/// Makes text safe inside of markup.
pub(crate) fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Returns a range that holds all numbers above zero, widened to look well on a logarithmic axis.
pub(crate) fn log_range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let (mut low, mut high) = (f64::INFINITY, 0.0f64);
    for value in values.filter(|v| v.is_finite() && *v > 0.0) {
        low = low.min(value);
        high = high.max(value);
    }
    if high <= 0.0 {
        return [0.1, 10.0];
    }
    let [low, high] = [low / 1.35, high * 1.35];
    if high / low < 8.0 { [low / 2.0, high * 2.0] } else { [low, high] }
}

impl Plot {
    /// Writes the plot into an SVG.
    pub(crate) fn draw(&self, svg: &mut String, place: Place) {
        let (left, top) = (place.left + 62.0, place.top + 26.0);
        let (width, height) = (place.width - 88.0, place.height - 72.0);
        let strip = if self.y.zero.is_some() { STRIP } else { 0.0 };
        let x = |v: f64| left + self.x.at(v) * width;
        let y = |v: f64| {
            if self.y.zero.is_some() && v <= 0.0 {
                top + height - strip * 0.5
            } else {
                top + (1.0 - self.y.at(v)) * (height - strip)
            }
        };
        // Writing into a string cannot fail.
        let mut put = |text: std::fmt::Arguments<'_>| {
            let _ = svg.write_fmt(text);
        };
        put(format_args!(
            "<text class=\"title\" x=\"{left:.0}\" y=\"{:.0}\">{}</text>",
            place.top + 14.0,
            escape(&self.title)
        ));
        for (value, label) in self.x.ticks() {
            let at = x(value);
            put(format_args!(
                "<path class=\"grid\" d=\"M{at:.1} {top:.1}V{:.1}\"/><text class=\"soft small\" x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{label}</text>",
                top + height,
                top + height + 16.0
            ));
        }
        for (value, label) in self.y.ticks() {
            let at = y(value);
            put(format_args!(
                "<path class=\"grid\" d=\"M{left:.1} {at:.1}h{width:.1}\"/><text class=\"soft small\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{label}</text>",
                left - 6.0,
                at + 4.0
            ));
        }
        if let Some(zero) = self.y.zero {
            put(format_args!(
                "<rect class=\"strip\" x=\"{left:.1}\" y=\"{:.1}\" width=\"{width:.1}\" height=\"{strip:.1}\"/><text class=\"soft small\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{zero}</text>",
                top + height - strip,
                left - 6.0,
                top + height - strip * 0.5 + 4.0
            ));
        }
        put(format_args!(
            "<rect class=\"edge\" x=\"{left:.1}\" y=\"{top:.1}\" width=\"{width:.1}\" height=\"{height:.1}\"/>"
        ));
        for (value, name) in &self.guides {
            if (self.x.range[0]..=self.x.range[1]).contains(value) {
                let at = x(*value);
                put(format_args!(
                    "<path class=\"guide\" d=\"M{at:.1} {top:.1}V{:.1}\"/><text class=\"soft small\" x=\"{:.1}\" y=\"{:.1}\">{}</text>",
                    top + height,
                    at + 4.0,
                    top + 12.0,
                    escape(name)
                ));
            }
        }
        for (value, name) in &self.levels {
            if *value <= 0.0 || (self.y.range[0]..=self.y.range[1]).contains(value) {
                let at = y(*value);
                put(format_args!(
                    "<path class=\"guide\" d=\"M{left:.1} {at:.1}h{width:.1}\"/><text class=\"soft small\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                    left + width - 4.0,
                    at - 4.0,
                    escape(name)
                ));
            }
        }
        put(format_args!(
            "<text class=\"soft\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
            left + width * 0.5,
            top + height + 34.0,
            escape(&self.x.label)
        ));
        put(format_args!(
            "<text class=\"soft\" transform=\"translate({:.1} {:.1}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
            place.left + 12.0,
            top + height * 0.5,
            escape(&self.y.label)
        ));
        for series in &self.series {
            series.draw_line(svg, &x, &y);
        }
        for series in &self.series {
            series.draw_marks(svg, &x, &y);
        }
    }
}

impl Series {
    fn draw_line(&self, svg: &mut String, x: &dyn Fn(f64) -> f64, y: &dyn Fn(f64) -> f64) {
        if self.line.is_empty() {
            return;
        }
        let mut path = String::new();
        for (i, [u, v]) in self.line.iter().enumerate() {
            let _ = write!(path, "{}{:.1} {:.1}", if i == 0 { 'M' } else { 'L' }, x(*u), y(*v));
        }
        if self.line.len() == 1 {
            path.push_str("h0.1");
        }
        let _ = write!(svg, "<path class=\"c{} {}\" d=\"{path}\"/>", self.color, self.line_class);
    }

    fn draw_marks(&self, svg: &mut String, x: &dyn Fn(f64) -> f64, y: &dyn Fn(f64) -> f64) {
        for mark in &self.marks {
            let (u, v) = (x(mark.x), y(mark.y));
            let index = mark.index.map_or(String::new(), |i| format!(" data-i=\"{i}\" tabindex=\"0\""));
            let _ =
                write!(svg, "<g class=\"c{} pt\"{index}><title>{}</title>", self.color, escape(&mark.text));
            if let Some([low, high]) = mark.spread {
                let _ = write!(svg, "<path class=\"bar\" d=\"M{:.1} {v:.1}H{:.1}\"/>", x(low), x(high));
            }
            let fill = if mark.is_solid { "solid" } else { "hollow" };
            let size = if mark.is_solid { 4.4 } else { 3.2 };
            let _ = write!(svg, "{}</g>", mark_shape(self.color, u, v, size, fill));
        }
    }
}

/// Draws a mark; each color has a form of its own, for readers who do not see colors.
pub(crate) fn mark_shape(color: usize, x: f64, y: f64, r: f64, fill: &str) -> String {
    let polygon = |corners: &[[f64; 2]]| {
        let places: Vec<String> =
            corners.iter().map(|[u, v]| format!("{:.1},{:.1}", x + u * r, y + v * r)).collect();
        format!("<polygon class=\"mark {fill}\" points=\"{}\"/>", places.join(" "))
    };
    match color {
        0 => polygon(&[[-1.4, -0.45], [1.4, -0.45], [1.4, 0.45], [-1.4, 0.45]]),
        2 => polygon(&[[-0.95, -0.95], [0.95, -0.95], [0.95, 0.95], [-0.95, 0.95]]),
        3 => polygon(&[[0.0, -1.2], [1.15, 0.9], [-1.15, 0.9]]),
        4 => polygon(&[[0.0, -1.35], [1.35, 0.0], [0.0, 1.35], [-1.35, 0.0]]),
        5 => polygon(&[[0.0, 1.2], [1.15, -0.9], [-1.15, -0.9]]),
        _ => format!("<circle class=\"mark {fill}\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{r}\"/>"),
    }
}

/// Wraps drawings into an SVG of a size.
pub(crate) fn document(width: f64, height: f64, label: &str, body: &str) -> String {
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" role=\"img\" aria-label=\"{}\"><style>{STYLE}</style><rect class=\"paper\" width=\"100%\" height=\"100%\"/>{body}</svg>",
        escape(label)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_true() {
        let expected = [
            (0.0, "0"),
            (1.0, "1"),
            (0.025, "0.025"),
            (16.6667, "16.7"),
            (1234.5, "1234"),
            (1e-5, "10⁻⁵"),
            (3.2e7, "3.20·10⁷"),
        ];
        for (value, text) in expected {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn a_decade_takes_equal_room_and_labels_are_at_powers() {
        let axis =
            PlotAxis { label: String::new(), scale: Scale::Log, range: [0.01, 100.0], zero: Some("0") };
        assert!((axis.at(1.0) - 0.5).abs() < 1e-12 && axis.at(0.0) == 0.0 && axis.at(1e9) == 1.0);
        let labels: Vec<String> =
            axis.ticks().into_iter().map(|(_, l)| l).filter(|l| !l.is_empty()).collect();
        assert_eq!(labels, ["0.01", "0.1", "1", "10", "100"]);
    }

    #[test]
    fn names_cannot_break_out_of_the_markup() {
        assert_eq!(escape("<a b=\"&\">"), "&lt;a b=&quot;&amp;&quot;&gt;");
    }
}
