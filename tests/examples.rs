//! Do the examples run, and does a new back end need nothing of another's files?

#[path = "../examples/choose_a_backend.rs"]
mod choose_a_backend;
#[path = "../examples/own_pixels.rs"]
mod own_pixels;
#[path = "../examples/write_a_backend.rs"]
mod write_a_backend;

#[test]
fn a_back_end_is_chosen_by_what_it_can() {
    choose_a_backend::main().unwrap();
    assert_eq!(image::open("out/cloud.png").unwrap().to_rgb8().dimensions(), (480, 270));
}

#[test]
fn a_back_end_is_written_in_one_file_and_draws() {
    write_a_backend::main().unwrap();
    let picture = image::open("out/boxes.png").unwrap().to_rgb8();
    assert_eq!(picture.dimensions(), (480, 270));
    let middle = picture.get_pixel(240, 150);
    let corner = picture.get_pixel(2, 2);
    assert_ne!(middle, corner, "something is drawn in the middle");
}

#[test]
fn pixels_go_to_a_screen_of_ones_own() {
    own_pixels::main().unwrap();
    let file = std::fs::read("out/own_pixels.ppm").unwrap();
    let pixels = file.strip_prefix(b"P6 90 60 255\n").unwrap();
    assert_eq!(pixels.len(), 90 * 60 * 3);
    assert!(pixels.iter().collect::<std::collections::HashSet<_>>().len() > 20, "a picture of many shades");
}
