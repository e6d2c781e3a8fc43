//! How right is each pane for the time it takes, now and before?

use crate::viewer::Viewer;
use eframe::egui::{self, Color32};
use egui_plot::{HoverPosition, Legend, Line, MarkerShape, Plot, PlotPoints, Points};
use polyptych::auto::UNSEEN;
use polyptych::chart::undominated;
use std::collections::VecDeque;
use std::time::Duration;

/// Most pictures that the history holds.
const MOST: usize = 2000;
/// Colors of back ends, apart for eyes that do not tell red from green.
const COLORS: [Color32; 7] = [
    Color32::from_rgb(0, 114, 178),
    Color32::from_rgb(230, 159, 0),
    Color32::from_rgb(0, 158, 115),
    Color32::from_rgb(213, 94, 0),
    Color32::from_rgb(204, 121, 167),
    Color32::from_rgb(86, 180, 233),
    Color32::from_rgb(160, 150, 40),
];

/// The pictures that were held against the reference.
#[derive(Default)]
pub(crate) struct LiveChart {
    history: VecDeque<Sample>,
}

struct Sample {
    backend: String,
    ms: f64,
    /// Root mean square error of the color, full scale 1.
    error: f64,
}

impl Sample {
    /// Its place on axes of logarithms. What nobody sees stands at the bottom.
    fn place(&self) -> [f64; 2] {
        [self.ms.max(1e-3).log10(), self.error.max(UNSEEN).log10()]
    }
}

impl LiveChart {
    pub(crate) fn add(&mut self, backend: &str, frame: Duration, error: f64) {
        if self.history.len() == MOST {
            self.history.pop_front();
        }
        self.history.push_back(Sample { backend: backend.to_owned(), ms: frame.as_secs_f64() * 1e3, error });
    }

    pub(crate) fn clear(&mut self) {
        self.history.clear();
    }

    /// Returns how many pictures it shows.
    pub(crate) fn count(&self) -> usize {
        self.history.len()
    }

    /// Lists the places of pictures that no other beats in both time and error, fastest first.
    fn front(&self) -> Vec<[f64; 2]> {
        let places: Vec<_> = self.history.iter().map(Sample::place).collect();
        let known = places.iter().enumerate().map(|(i, place)| (i, place[0], place[1]));
        undominated(known.collect()).into_iter().map(|i| places[i]).collect()
    }

    fn show(&self, ui: &mut egui::Ui) {
        let mut backends: Vec<&str> = self.history.iter().map(|s| s.backend.as_str()).collect();
        backends.sort_unstable();
        backends.dedup();
        let plot = Plot::new("error against time")
            .legend(Legend::default())
            .x_axis_label("ms a frame")
            .y_axis_label("error (rmse)")
            .x_axis_formatter(|mark, _| power(mark.value))
            .y_axis_formatter(|mark, _| power(mark.value))
            .label_formatter(|hovered| match hovered {
                HoverPosition::NearDataPoint { plot_name, position: p, .. } => {
                    Some(format!("{plot_name}\n{} ms\nerror {}", power(p.x), power(p.y)))
                }
                HoverPosition::Elsewhere { .. } => None,
            });
        plot.show(ui, |plot| {
            plot.line(Line::new("front", PlotPoints::from(self.front())).color(Color32::GRAY));
            for (backend, color) in backends.into_iter().zip(COLORS.iter().cycle()) {
                let own: Vec<_> =
                    self.history.iter().filter(|s| s.backend == backend).map(Sample::place).collect();
                let last = own.last().copied().into_iter().collect::<Vec<_>>();
                plot.points(Points::new(backend, PlotPoints::from(own)).color(*color).radius(2.0));
                plot.points(
                    Points::new(backend, PlotPoints::from(last))
                        .color(*color)
                        .radius(6.0)
                        .shape(MarkerShape::Diamond),
                );
            }
        });
    }
}

/// Writes the number that a logarithm stands for.
fn power(exponent: f64) -> String {
    let value = 10f64.powf(exponent);
    if (0.01..10_000.0).contains(&value) {
        let decimals = (2.0 - exponent.floor()).max(0.0) as usize;
        let text = format!("{value:.decimals$}");
        if decimals == 0 { text } else { text.trim_end_matches('0').trim_end_matches('.').to_owned() }
    } else {
        format!("{value:.1e}")
    }
}

impl Viewer {
    /// Shows error against time of every pane.
    pub(crate) fn show_chart(&mut self, ui: &mut egui::Ui) {
        egui::Panel::bottom("chart").resizable(true).default_size(220.0).show(ui, |ui| {
            ui.horizontal(|ui| {
                ui.strong("Error against time");
                ui.label(format!(
                    "{} pictures, the newest large; the line joins those that nothing beats. Turn the camera for more.",
                    self.chart.count()
                ));
                if ui.button("Forget").clicked() {
                    self.chart.clear();
                }
            });
            self.chart.show(ui);
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_front_is_what_nothing_beats() {
        let mut chart = LiveChart::default();
        for (ms, error) in [(10, 0.1), (20, 0.05), (15, 0.2), (40, 0.05), (30, 0.01)] {
            chart.add("raster", Duration::from_millis(ms), error);
        }
        let front: Vec<_> = chart.front().iter().map(|p| (power(p[0]), power(p[1]))).collect();
        let expected = [("10", "0.1"), ("20", "0.05"), ("30", "0.01")];
        assert_eq!(front, expected.map(|(a, b)| (a.to_owned(), b.to_owned())));
    }
}
