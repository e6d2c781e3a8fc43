//! How are pictures written to files?

use eframe::egui::{Color32, ColorImage};
use font8x8::UnicodeFonts;
use polyptych::picture::{encode, write_whole};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Returns a file name in the current folder that is not taken yet.
pub(crate) fn unused(what: &str) -> PathBuf {
    let names = (1..10_000).map(|i| PathBuf::from(format!("polyptych-{what}-{i}.png")));
    names
        .into_iter()
        .find(|path| !path.exists())
        .unwrap_or_else(|| PathBuf::from(format!("polyptych-{what}.png")))
}

pub(crate) fn write_picture(image: &ColorImage, file: &Path) -> Result<(), String> {
    let pixels: Vec<_> = image.pixels.iter().map(|p| [p.r(), p.g(), p.b()]).collect();
    let bytes = encode(&pixels, image.width() as u32, image.height() as u32, "png")?;
    write_whole(file, &bytes).map_err(|error| format!("{}: cannot be written: {error}", file.display()))
}

/// Lays pictures beside one another, with a line of text above each.
pub(crate) fn sheet(panes: &[(String, Arc<ColorImage>)]) -> ColorImage {
    const MARGIN: usize = 4;
    const LINE: usize = 20;
    let columns = (1..=panes.len()).find(|c| c * c >= panes.len()).unwrap_or(1);
    let cell = panes.iter().fold([1, 1], |[w, h], (_, p)| [p.width().max(w), p.height().max(h)]);
    let [width, height] = [cell[0] + MARGIN, cell[1] + MARGIN + LINE];
    let size = [columns * width, panes.len().div_ceil(columns).max(1) * height];
    let mut sheet = ColorImage::filled(size, Color32::WHITE);
    for (index, (caption, picture)) in panes.iter().enumerate() {
        let (left, top) = (index % columns * width, index / columns * height);
        for (y, row) in picture.pixels.chunks_exact(picture.width().max(1)).enumerate() {
            let first = (top + LINE + y) * size[0] + left;
            sheet.pixels[first..first + row.len()].copy_from_slice(row);
        }
        for (x, y) in letters(caption).filter(|(x, _)| *x < width) {
            sheet.pixels[(top + 6 + y) * size[0] + left + x] = Color32::BLACK;
        }
    }
    sheet
}

/// Lists the pixels of a line of text, eight by eight for each letter.
fn letters(text: &str) -> impl Iterator<Item = (usize, usize)> {
    text.chars().enumerate().flat_map(|(index, letter)| {
        let glyph = font8x8::BASIC_FONTS.get(letter).unwrap_or([0; 8]);
        let pixels = (0..64).filter(move |i| glyph[i / 8] >> (i % 8) & 1 == 1);
        pixels.map(move |i| (index * 8 + i % 8, i / 8))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sheet_holds_all_pictures_and_their_names() {
        let picture = |gray: u8| Arc::new(ColorImage::filled([30, 20], Color32::from_gray(gray)));
        let panes =
            [("a".to_owned(), picture(10)), ("b".to_owned(), picture(20)), ("c".to_owned(), picture(30))];
        let sheet = sheet(&panes);
        assert_eq!(sheet.size, [68, 88]);
        let count = |color| sheet.pixels.iter().filter(|p| **p == color).count();
        assert!([10, 20, 30].iter().all(|&gray| count(Color32::from_gray(gray)) == 600));
        assert!(count(Color32::BLACK) > 30, "three letters");
    }
}
