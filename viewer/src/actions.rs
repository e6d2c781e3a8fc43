//! What can be done, by which key, and from which menu? One table, which menus, keys and the palette are made from.

use crate::viewer::Viewer;
use eframe::egui::{Context, Key, KeyboardShortcut, Modifiers};

/// Everything that can be done without pointing at something.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "the table says what each does")]
pub enum Action {
    Open,
    Save,
    SaveAs,
    Reload,
    Watch,
    Screenshot,
    Sheet,
    Quit,
    Undo,
    Redo,
    Duplicate,
    Delete,
    FrameAll,
    FrameChosen,
    Front,
    Back,
    Left,
    Right,
    Top,
    Bottom,
    Level,
    SceneCamera,
    Parallel,
    Wider,
    Narrower,
    Turntable,
    AddPane,
    RemovePane,
    NextPane,
    Backend(u8),
    NextChannel,
    SideBySide,
    Wipe,
    Flip,
    Difference,
    ErrorMaps,
    EqualTime,
    EqualError,
    Objects,
    Settings,
    Values,
    Errors,
    Chart,
    ClearChart,
    NoTool,
    Move,
    Turn,
    Scale,
    Paint,
    Erase,
    Raise,
    Lower,
    Palette,
    Welcome,
    Theme,
    Larger,
    Smaller,
    FullScreen,
}

/// Where an action is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "the names of the menus")]
pub enum Menu {
    File,
    Edit,
    Camera,
    Panes,
    Show,
    Tools,
    Help,
}

impl Menu {
    /// All menus with their names, in order.
    pub(crate) const ALL: [(Self, &str); 7] = [
        (Self::File, "File"),
        (Self::Edit, "Edit"),
        (Self::Camera, "View"),
        (Self::Panes, "Panes"),
        (Self::Show, "Show"),
        (Self::Tools, "Tools"),
        (Self::Help, "Help"),
    ];
}

/// A line of the table.
#[derive(Clone, Copy, Debug)]
pub struct Entry {
    /// What is done.
    pub action: Action,
    /// Where it is found.
    pub menu: Menu,
    /// Its name in menus and palette.
    pub name: &'static str,
    /// Its key.
    pub key: Option<KeyboardShortcut>,
    /// What it does, in a sentence.
    pub help: &'static str,
}

const fn entry(
    action: Action,
    menu: Menu,
    name: &'static str,
    key: Option<(Modifiers, Key)>,
    help: &'static str,
) -> Entry {
    let key = match key {
        Some((modifiers, key)) => Some(KeyboardShortcut::new(modifiers, key)),
        None => None,
    };
    Entry { action, menu, name, key, help }
}

const fn plain(key: Key) -> Option<(Modifiers, Key)> {
    Some((Modifiers::NONE, key))
}

const fn shift(key: Key) -> Option<(Modifiers, Key)> {
    Some((Modifiers::SHIFT, key))
}

const fn command(key: Key) -> Option<(Modifiers, Key)> {
    Some((Modifiers::COMMAND, key))
}

const fn command_shift(key: Key) -> Option<(Modifiers, Key)> {
    Some((Modifiers::COMMAND.plus(Modifiers::SHIFT), key))
}

/// All actions. Keys that fly (WASD, Q and E, comma and period) are held, and stand in `navigation`.
#[rustfmt::skip]
pub const ACTIONS: &[Entry] = &[
    entry(Action::Open, Menu::File, "Open ...", command(Key::O), "Opens a scene file, a model, or a built-in scene"),
    entry(Action::Save, Menu::File, "Save", command(Key::S), "Writes the scene to its file"),
    entry(Action::SaveAs, Menu::File, "Save as ...", command_shift(Key::S), "Writes the scene to another file, .ron or .json"),
    entry(Action::Reload, Menu::File, "Reload", plain(Key::F5), "Reads the scene's file again; an edit can be brought back by undo"),
    entry(Action::Watch, Menu::File, "Watch the file", None, "Reads the scene's file again whenever another program writes it"),
    entry(Action::Screenshot, Menu::File, "Save a screenshot", plain(Key::F12), "Writes a picture of the window"),
    entry(Action::Sheet, Menu::File, "Save a sheet", shift(Key::F12), "Writes the pictures of all panes beside one another, with their names and times"),
    entry(Action::Quit, Menu::File, "Quit", command(Key::Q), "Closes the window; what is not saved is offered again at the next start"),
    entry(Action::Undo, Menu::Edit, "Undo", command(Key::Z), "Takes back the last change of the scene"),
    entry(Action::Redo, Menu::Edit, "Redo", command(Key::Y), "Makes the change again that was taken back last"),
    entry(Action::Duplicate, Menu::Edit, "Duplicate", command(Key::D), "Puts a copy of what is chosen beside it"),
    entry(Action::Delete, Menu::Edit, "Delete", plain(Key::Delete), "Takes what is chosen out of the scene"),
    entry(Action::FrameAll, Menu::Camera, "Show everything", plain(Key::F), "Moves back or forth until all of the scene is seen"),
    entry(Action::FrameChosen, Menu::Camera, "Show what is chosen", shift(Key::F), "Moves to the chosen object, and turns around it from now on"),
    entry(Action::Front, Menu::Camera, "From the front", shift(Key::Num1), "Looks along -z"),
    entry(Action::Back, Menu::Camera, "From behind", shift(Key::Num2), "Looks along z"),
    entry(Action::Left, Menu::Camera, "From the left", shift(Key::Num3), "Looks along x"),
    entry(Action::Right, Menu::Camera, "From the right", shift(Key::Num4), "Looks along -x"),
    entry(Action::Top, Menu::Camera, "From above", shift(Key::Num5), "Looks along -y"),
    entry(Action::Bottom, Menu::Camera, "From below", shift(Key::Num6), "Looks along y"),
    entry(Action::Level, Menu::Camera, "Level the horizon", plain(Key::L), "Takes the roll out of the view"),
    entry(Action::SceneCamera, Menu::Camera, "Next camera of the scene", plain(Key::Home), "Looks through the cameras that the scene's author saved, one after the other"),
    entry(Action::Parallel, Menu::Camera, "Perspective or parallel", plain(Key::P), "Changes between perspective and parallel projection; what is in the middle keeps its size"),
    entry(Action::Wider, Menu::Camera, "Wider field of view", plain(Key::CloseBracket), "Sees more at once"),
    entry(Action::Narrower, Menu::Camera, "Narrower field of view", plain(Key::OpenBracket), "Sees less at once"),
    entry(Action::Turntable, Menu::Camera, "Turntable", plain(Key::T), "Turns the camera around the scene until it is pressed again"),
    entry(Action::AddPane, Menu::Panes, "One pane more", plain(Key::Plus), "Opens another pane"),
    entry(Action::RemovePane, Menu::Panes, "One pane less", plain(Key::Minus), "Closes the last pane"),
    entry(Action::NextPane, Menu::Panes, "Next pane", plain(Key::N), "Keys act on the next pane"),
    entry(Action::Backend(0), Menu::Panes, "Back end 1", plain(Key::Num1), "The chosen pane is drawn by the first back end"),
    entry(Action::Backend(1), Menu::Panes, "Back end 2", plain(Key::Num2), "The chosen pane is drawn by the second back end"),
    entry(Action::Backend(2), Menu::Panes, "Back end 3", plain(Key::Num3), "The chosen pane is drawn by the third back end"),
    entry(Action::Backend(3), Menu::Panes, "Back end 4", plain(Key::Num4), "The chosen pane is drawn by the fourth back end"),
    entry(Action::Backend(4), Menu::Panes, "Back end 5", plain(Key::Num5), "The chosen pane is drawn by the fifth back end"),
    entry(Action::Backend(5), Menu::Panes, "Back end 6", plain(Key::Num6), "The chosen pane is drawn by the sixth back end"),
    entry(Action::Backend(6), Menu::Panes, "Back end 7", plain(Key::Num7), "The chosen pane is drawn by the seventh back end"),
    entry(Action::Backend(7), Menu::Panes, "Back end 8", plain(Key::Num8), "The chosen pane is drawn by the eighth back end"),
    entry(Action::Backend(8), Menu::Panes, "Back end 9", plain(Key::Num9), "The chosen pane is drawn by the ninth back end"),
    entry(Action::NextChannel, Menu::Panes, "Next channel", plain(Key::C), "Color, distance, normals, ids, albedo, shadow, coverage"),
    entry(Action::SideBySide, Menu::Panes, "Side by side", None, "All panes beside one another"),
    entry(Action::Wipe, Menu::Panes, "Wipe", plain(Key::X), "The first two panes over one another, with a line between them to drag"),
    entry(Action::Flip, Menu::Panes, "Flip", plain(Key::Z), "The first pane; the second in its place while space is held"),
    entry(Action::Difference, Menu::Panes, "Difference", plain(Key::G), "How far the first two panes are apart, pixel by pixel"),
    entry(Action::ErrorMaps, Menu::Panes, "Error maps", shift(Key::G), "How far each pane is from the reference, pixel by pixel"),
    entry(Action::EqualTime, Menu::Panes, "Equal time", None, "Every back end gets the same milliseconds, and is as right as it can be in them"),
    entry(Action::EqualError, Menu::Panes, "Equal error", None, "Every back end may be equally wrong, and is as fast as it can be then"),
    entry(Action::Objects, Menu::Show, "Objects", plain(Key::O), "What is in the scene, and its fields"),
    entry(Action::Settings, Menu::Show, "Settings", plain(Key::I), "The parameters of the chosen pane's back end"),
    entry(Action::Values, Menu::Show, "Values", plain(Key::V), "What all panes say of the place under the mouse"),
    entry(Action::Errors, Menu::Show, "Errors", plain(Key::R), "How far every pane is from the exact reference"),
    entry(Action::Chart, Menu::Show, "Chart", plain(Key::H), "Error against time of every pane, live"),
    entry(Action::ClearChart, Menu::Show, "Clear the chart", None, "Forgets the history of the chart"),
    entry(Action::NoTool, Menu::Tools, "Choose", plain(Key::Escape), "A click chooses what is seen; a drag turns the camera"),
    entry(Action::Move, Menu::Tools, "Move", plain(Key::M), "Arrows to drag the chosen thing along the axes"),
    entry(Action::Turn, Menu::Tools, "Turn", plain(Key::J), "Rings to turn the chosen thing around the axes"),
    entry(Action::Scale, Menu::Tools, "Scale", plain(Key::K), "Handles to scale the chosen thing along the axes"),
    entry(Action::Paint, Menu::Tools, "Paint voxels", plain(Key::B), "Puts voxels where the mouse is dragged over a grid"),
    entry(Action::Erase, Menu::Tools, "Erase voxels", shift(Key::B), "Takes voxels away where the mouse is dragged"),
    entry(Action::Raise, Menu::Tools, "Raise terrain", plain(Key::U), "Lifts a height field where the mouse is dragged"),
    entry(Action::Lower, Menu::Tools, "Lower terrain", shift(Key::U), "Presses a height field down where the mouse is dragged"),
    entry(Action::Palette, Menu::Help, "All actions ...", command(Key::P), "Finds an action by its name or key, and does it"),
    entry(Action::Welcome, Menu::Help, "How to begin", plain(Key::F1), "Says how to compare two back ends"),
    entry(Action::Theme, Menu::Help, "Light or dark", command(Key::L), "Changes between light and dark colors of the window"),
    entry(Action::Larger, Menu::Help, "Larger letters", command(Key::Plus), "Makes all of the window's controls larger"),
    entry(Action::Smaller, Menu::Help, "Smaller letters", command(Key::Minus), "Makes all of the window's controls smaller"),
    entry(Action::FullScreen, Menu::Help, "Full screen", plain(Key::F11), "Takes the whole screen, or gives it back"),
];

/// Finds the entry of an action.
pub(crate) fn entry_of(action: Action) -> &'static Entry {
    ACTIONS.iter().find(|entry| entry.action == action).unwrap_or(&ACTIONS[0])
}

impl Viewer {
    /// Does what the keys say that were pressed.
    pub(crate) fn follow_keys(&mut self, ctx: &Context) {
        // With more modifiers first: Ctrl-Shift-S is not Ctrl-S.
        let modifiers =
            |e: &Entry| e.key.map_or(0, |k| u8::from(k.modifiers.command) + u8::from(k.modifiers.shift));
        let is_writing = ctx.text_edit_focused();
        for count in [2, 1, 0] {
            for entry in ACTIONS.iter().filter(|e| modifiers(e) == count) {
                let Some(key) = entry.key else { continue };
                // While text is written, letters are letters.
                let is_taken = is_writing && !key.modifiers.command && !is_function_key(key.logical_key);
                if !is_taken && ctx.input_mut(|i| consume(i, key)) {
                    self.perform(entry.action, ctx);
                }
            }
        }
    }
}

fn is_function_key(key: Key) -> bool {
    matches!(key, Key::F1 | Key::F5 | Key::F11 | Key::F12)
}

/// Takes a key press with exactly these modifiers. Digits count by their place: with shift they are other signs.
fn consume(input: &mut eframe::egui::InputState, key: KeyboardShortcut) -> bool {
    let mut is_pressed = false;
    input.events.retain(|event| {
        let eframe::egui::Event::Key { key: logical, physical_key, pressed: true, modifiers, .. } = event
        else {
            return true;
        };
        let is_key =
            *logical == key.logical_key || (key.modifiers.shift && *physical_key == Some(key.logical_key));
        // A plus may need shift.
        let shift_counts = key.logical_key != Key::Plus;
        let same = (modifiers.command, modifiers.alt) == (key.modifiers.command, false)
            && (!shift_counts || modifiers.shift == key.modifiers.shift);
        is_pressed |= is_key && same;
        !(is_key && same)
    });
    is_pressed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_action_has_its_own_name_and_key() {
        for (index, entry) in ACTIONS.iter().enumerate() {
            assert!(entry.help.len() > 10, "{}", entry.name);
            for other in &ACTIONS[..index] {
                assert_ne!((entry.name, entry.action), (other.name, other.action));
                assert_ne!(entry.name, other.name);
                assert!(entry.key.is_none() || entry.key != other.key, "{} and {}", entry.name, other.name);
            }
            // Keys that are held to fly.
            let flies = [Key::W, Key::A, Key::S, Key::D, Key::Q, Key::E, Key::Comma, Key::Period];
            assert!(!entry.key.is_some_and(|k| k.modifiers.is_none() && flies.contains(&k.logical_key)));
        }
    }
}
