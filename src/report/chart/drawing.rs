//! What does a chart look like?

use super::{FRAME_MS, fronts, of, settings_text};
use crate::chart::{Chart, Growth, Measure, Point, Quantity, front};
use crate::report::page::{machine, today};
use crate::report::plot::{
    Mark, Place, Plot, PlotAxis, Scale, Series, document, escape, log_range, mark_shape, number,
};
use std::fmt::Write as _;

/// Width of a drawing, and most panels beside each other in it.
const WIDTH: f64 = 1260.0;
const COLUMNS: usize = 3;

/// Places panels in rows: a few of them are larger.
struct Grid {
    columns: usize,
    panel: [f64; 2],
}

impl Grid {
    fn of(count: usize) -> Self {
        let columns = count.clamp(1, COLUMNS);
        Self { columns, panel: [WIDTH / columns as f64, [470.0, 360.0, 300.0][columns - 1]] }
    }

    fn place(&self, index: usize, top: f64) -> Place {
        Place {
            left: (index % self.columns) as f64 * self.panel[0],
            top: top + (index / self.columns) as f64 * self.panel[1],
            width: self.panel[0],
            height: self.panel[1],
        }
    }

    fn height(&self, count: usize) -> f64 {
        count.div_ceil(self.columns) as f64 * self.panel[1]
    }
}

/// Draws all panels for one measure of error.
#[must_use]
pub fn svg(chart: &Chart, measure: Measure) -> String {
    let shown = || chart.points.iter().filter(|p| measure.of(p).is_some());
    let times = log_range(shown().flat_map(|p| [p.ms.low, p.ms.high]));
    let errors = log_range(shown().filter_map(|p| measure.of(p)).filter(|e| *e > nothing(measure)));
    let grid = Grid::of(chart.scenes.len());
    let head = 84.0;
    let all = if chart.scenes.len() > 1 { 420.0 } else { 0.0 };
    let scenes = grid.height(chart.scenes.len());
    let mut body = heading(chart);
    for (i, scene) in chart.scenes.iter().enumerate() {
        panel(chart, scene, measure, times, errors).draw(&mut body, grid.place(i, head));
    }
    if chart.scenes.len() > 1 {
        let place = Place { left: 0.0, top: head + scenes, width: WIDTH, height: all };
        together(chart, measure, times, errors).draw(&mut body, place);
    }
    let height = head + scenes + all + 8.0;
    document(WIDTH, height, "Error against time of a frame, back end by back end", &body)
}

/// Says how many threads there were and whether they stayed where they were.
pub(super) fn threads_text(chart: &Chart) -> String {
    match (chart.threads, chart.pinned) {
        (1, true) => "1 thread on a core of its own".to_owned(),
        (n, true) => format!("{n} threads on cores of their own"),
        (n, false) => format!("{n} thread{} that wander from core to core", if n == 1 { "" } else { "s" }),
    }
}

/// Writes the title, what was measured where, and the legend.
fn heading(chart: &Chart) -> String {
    let mut body = format!(
        "<text x=\"16\" y=\"24\" style=\"font-size:18px;font-weight:650\">Error against time: lower and further left is better</text>\
         <text class=\"soft\" x=\"16\" y=\"43\">{}</text>",
        escape(&format!(
            "{}x{} pixels, {}, {}, {}",
            chart.width,
            chart.height,
            threads_text(chart),
            machine(),
            today()
        ))
    );
    let mut x = 22.0;
    for (index, (_, name)) in chart.backends.iter().enumerate() {
        let color = color_of(chart, index);
        let _ = write!(
            body,
            "<g class=\"c{color}\">{}</g><text x=\"{:.0}\" y=\"66\">{}</text>",
            mark_shape(color, x, 62.0, 4.4, "solid"),
            x + 11.0,
            escape(name)
        );
        x += 30.0 + name.chars().count() as f64 * 6.6;
    }
    let _ = write!(
        body,
        "<path class=\"best\" d=\"M{:.0} 62h26\"/><text class=\"soft\" x=\"{:.0}\" y=\"66\">best of all; filled: nothing of the same back end beats it; bar: spread</text>",
        x,
        x + 34.0
    );
    body
}

/// Returns the class of a back end's color: built-in ones have the same in every chart.
pub(super) fn color_of(chart: &Chart, index: usize) -> usize {
    let built_in = ["reference", "raster", "voxel", "freeform", "stylized"];
    let id = chart.backends[index].0.as_str();
    let others = || chart.backends[..index].iter().filter(|(b, _)| !built_in.contains(&b.as_str())).count();
    built_in.iter().position(|b| *b == id).unwrap_or_else(|| 5 + others() % 3)
}

fn axes(measure: Measure, times: [f64; 2], errors: [f64; 2]) -> (PlotAxis, PlotAxis) {
    let x = PlotAxis {
        label: "time of a frame (median), ms".to_owned(),
        scale: Scale::Log,
        range: times,
        zero: None,
    };
    let y =
        PlotAxis { label: measure.label().to_owned(), scale: Scale::Log, range: errors, zero: Some("none") };
    (x, y)
}

fn guides() -> Vec<(f64, String)> {
    vec![(FRAME_MS, "60 Hz".to_owned())]
}

/// Draws one scene.
fn panel(chart: &Chart, scene: &str, measure: Measure, times: [f64; 2], errors: [f64; 2]) -> Plot {
    let (x, y) = axes(measure, times, errors);
    let mut series = Vec::new();
    let everything = fronts(chart, measure);
    let best = everything
        .iter()
        .map(|&i| &chart.points[i])
        .filter(|p| p.scene == scene)
        .map(|p| [p.ms.median, shown_error(measure, p)]);
    series.push(Series { line: best.collect(), line_class: "best", ..Series::default() });
    for (index, (backend, _)) in chart.backends.iter().enumerate() {
        let (members, points) = of(chart, scene, backend);
        let own = front(&points, measure);
        let marks = points.iter().enumerate().filter(|(_, p)| measure.of(p).is_some()).map(|(i, p)| Mark {
            x: p.ms.median,
            y: shown_error(measure, p),
            spread: Some([p.ms.low, p.ms.high]),
            is_solid: own.contains(&i),
            text: format!(
                "{backend}: {}: {} ms, error {}",
                settings_text(p),
                number(p.ms.median),
                number(measure.of(p).unwrap_or(0.0))
            ),
            index: Some(members[i]),
        });
        let mut marks: Vec<Mark> = marks.collect();
        marks.sort_by_key(|m| m.is_solid);
        series.push(Series {
            color: color_of(chart, index),
            marks,
            line: own.iter().map(|&i| [points[i].ms.median, shown_error(measure, points[i])]).collect(),
            line_class: "front",
        });
    }
    // Of a file its name is enough here; the page's tables have the whole path.
    let title = scene.rsplit(['/', '\\']).next().unwrap_or(scene).to_owned();
    Plot { title, x, y, series, guides: guides(), levels: Vec::new() }
}

/// Returns the error below which there is none to be seen or told from rounding: for colors far below a step of a
/// screen (4e-3), for the others that of single precision.
fn nothing(measure: Measure) -> f64 {
    match measure {
        Measure::Color | Measure::Antialiased => 1e-5,
        Measure::Distance => 3e-7,
        Measure::NormalDeg => 1e-4,
        Measure::Silhouette => 0.0,
    }
}

fn shown_error(measure: Measure, point: &Point) -> f64 {
    measure.of(point).filter(|e| *e > nothing(measure)).unwrap_or(0.0)
}

/// Draws the fronts of all scenes in one plot.
fn together(chart: &Chart, measure: Measure, times: [f64; 2], errors: [f64; 2]) -> Plot {
    let (x, y) = axes(measure, times, errors);
    let mut series = Vec::new();
    for (index, (backend, _)) in chart.backends.iter().enumerate() {
        for scene in &chart.scenes {
            let (members, points) = of(chart, scene, backend);
            let own = front(&points, measure);
            let place = |i: usize| [points[i].ms.median, shown_error(measure, points[i])];
            series.push(Series {
                color: color_of(chart, index),
                marks: own
                    .iter()
                    .map(|&i| Mark {
                        x: place(i)[0],
                        y: place(i)[1],
                        spread: None,
                        is_solid: true,
                        text: format!("{backend} in {scene}: {}", settings_text(points[i])),
                        index: Some(members[i]),
                    })
                    .collect(),
                line: own.iter().map(|&i| place(i)).collect(),
                line_class: "thin",
            });
        }
    }
    let title = "All scenes: each line is what one back end can do at best in one scene".to_owned();
    Plot { title, x, y, series, guides: guides(), levels: Vec::new() }
}

/// Draws how cost grows, one panel for each quantity.
pub(super) fn growth_svg(chart: &Chart, of_bytes: bool) -> String {
    let mut quantities: Vec<_> = chart.growth.iter().map(|g| g.quantity).collect();
    quantities.dedup();
    let grid = Grid::of(quantities.len());
    let mut body = String::new();
    for (i, quantity) in quantities.iter().enumerate() {
        let lines: Vec<&Growth> = chart.growth.iter().filter(|g| g.quantity == *quantity).collect();
        let costs = |g: &Growth| -> Vec<f64> {
            if of_bytes {
                g.bytes.iter().map(|&b| b as f64 / 1024.0).collect()
            } else {
                g.ms.iter().map(|m| m.median).collect()
            }
        };
        let series = lines.iter().map(|g| {
            let places: Vec<[f64; 2]> = g.counts.iter().zip(costs(g)).map(|(&c, v)| [c, v]).collect();
            let exponent = if of_bytes { g.bytes_exponent } else { Some(g.time_exponent) };
            let name = exponent.map_or(String::new(), |e| format!(" grows with the power {e:.2}"));
            let mark = |(i, p): (usize, &[f64; 2])| Mark {
                x: p[0],
                y: p[1],
                spread: None,
                is_solid: true,
                text: format!("{}{name}; at {}: {}", g.backend, number(g.counts[i]), number(p[1])),
                index: None,
            };
            let color =
                chart.backends.iter().position(|(b, _)| *b == g.backend).map_or(0, |b| color_of(chart, b));
            Series {
                color,
                marks: places.iter().enumerate().map(mark).collect(),
                line: places,
                line_class: "front",
            }
        });
        // Threads are few and are counted one by one.
        let is_few = *quantity == Quantity::Threads;
        let most = lines.iter().flat_map(|g| g.counts.clone()).fold(1.0, f64::max);
        let plot = Plot {
            title: quantity.name().to_owned(),
            x: PlotAxis {
                label: format!("number of {}", quantity.name()),
                scale: if is_few { Scale::Linear } else { Scale::Log },
                range: if is_few {
                    [0.5, most + 0.5]
                } else {
                    log_range(lines.iter().flat_map(|g| g.counts.clone()))
                },
                zero: None,
            },
            y: PlotAxis {
                label: if of_bytes { "memory, KiB" } else { "time of a frame, ms" }.to_owned(),
                scale: Scale::Log,
                range: log_range(lines.iter().flat_map(|g| costs(g))),
                zero: None,
            },
            series: series.collect(),
            guides: Vec::new(),
            levels: Vec::new(),
        };
        plot.draw(&mut body, grid.place(i, 0.0));
    }
    document(WIDTH, grid.height(quantities.len()) + 4.0, "Growth of cost", &body)
}
