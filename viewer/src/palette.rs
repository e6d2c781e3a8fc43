//! How is an action found by a part of its name or by its key?

use crate::actions::{ACTIONS, Action, Entry};
use crate::viewer::Viewer;
use eframe::egui::{self, Align2, Context, Key, Vec2};

/// The list of all actions, while it is open.
#[derive(Default)]
pub(crate) struct Palette {
    words: String,
    /// Which of the actions that fit the enter key does.
    at: usize,
}

/// Lists the actions whose name, key or description hold all words, the best first.
fn fitting(words: &str, ctx: &Context) -> Vec<&'static Entry> {
    let words: Vec<_> = words.split_whitespace().map(str::to_lowercase).collect();
    let key = |entry: &Entry| entry.key.map_or(String::new(), |key| ctx.format_shortcut(&key));
    let text = |entry: &Entry| format!("{} {} {}", entry.name, key(entry), entry.help).to_lowercase();
    let mut found: Vec<_> =
        ACTIONS.iter().filter(|e| words.iter().all(|word| text(e).contains(word))).collect();
    let whole = words.join(" ");
    let rank = |entry: &Entry| {
        let name = entry.name.to_lowercase();
        let holds = words.iter().all(|word| name.contains(word) || key(entry).to_lowercase() == *word);
        (name != whole, !name.starts_with(&whole), !holds)
    };
    found.sort_by_key(|entry| rank(entry));
    found
}

impl Viewer {
    /// Shows the list of all actions, if it is open.
    pub(crate) fn show_palette(&mut self, ctx: &Context) {
        let Some(mut palette) = self.palette.take() else { return };
        let found = fitting(&palette.words, ctx);
        let pressed = |key| ctx.input_mut(|i| i.consume_key(egui::Modifiers::NONE, key));
        if pressed(Key::ArrowDown) {
            palette.at += 1;
        }
        if pressed(Key::ArrowUp) {
            palette.at = palette.at.saturating_sub(1);
        }
        palette.at = palette.at.min(found.len().saturating_sub(1));
        let mut chosen = None;
        if pressed(Key::Enter) {
            chosen = found.get(palette.at).map(|e| e.action);
        }
        egui::Window::new("All actions")
            .collapsible(false)
            .resizable(false)
            .fade_in(false)
            .anchor(Align2::CENTER_TOP, Vec2::new(0.0, 60.0))
            .show(ctx, |ui| {
                ui.set_width(460.0);
                let label = ui.label("What do you want to do?").id;
                let field = egui::TextEdit::singleline(&mut palette.words)
                    .hint_text("a part of a name, or a key")
                    .desired_width(f32::INFINITY);
                ui.add(field).labelled_by(label).request_focus();
                let list = egui::ScrollArea::vertical().max_height(320.0).auto_shrink([false, true]);
                list.show(ui, |ui| chosen = chosen.or(self.show_found(ui, &found, palette.at)));
            });
        match chosen {
            Some(Action::Palette) => {}
            Some(action) => self.perform(action, ctx),
            None => self.palette = Some(palette),
        }
    }

    fn show_found(&self, ui: &mut egui::Ui, found: &[&Entry], at: usize) -> Option<Action> {
        let mut chosen = None;
        for (index, entry) in found.iter().enumerate() {
            let key = entry.key.map_or(String::new(), |key| ui.ctx().format_shortcut(&key));
            let button = egui::Button::selectable(index == at, entry.name).shortcut_text(key);
            let button = ui.add_enabled(self.can(entry.action), button.min_size(Vec2::new(440.0, 0.0)));
            if index == at {
                button.scroll_to_me(None);
                ui.weak(entry.help);
            }
            if button.on_hover_text(entry.help).clicked() {
                chosen = Some(entry.action);
            }
        }
        chosen
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn actions_are_found_by_words_and_keys() {
        let ctx = Context::default();
        let names = |words| fitting(words, &ctx).iter().map(|e| e.name).collect::<Vec<_>>();
        assert_eq!(names("").len(), ACTIONS.len());
        assert_eq!(names("WIPE")[0], "Wipe");
        assert_eq!(names("f12")[0], "Save a screenshot");
        assert_eq!(names("turn")[..2], ["Turn", "Turntable"]);
        assert_eq!(names("field narrow"), ["Narrower field of view"]);
        assert!(names("fly to the moon").is_empty());
    }
}
