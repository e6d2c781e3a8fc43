//! Is what is drawn whole, repeatable, and reported?

use super::{Subject, hold, scene};
use crate::framebuffer::{Band, Channel, Channels, Framebuffer};
use crate::prelude::*;
use glam::Vec3;
use std::sync::Arc;

/// The default scene holds every kind of shape.
const EVERYTHING: &str = "atelier";

pub(super) fn same_bytes(subject: &Subject) -> Result<(), String> {
    let scene = scene(EVERYTHING)?;
    // A size that is no multiple of anything.
    let need = subject.need(&scene, 97, 61)?;
    let one = subject.draw(1, &scene, &need)?.framebuffer;
    for threads in [2, 4] {
        let other = subject.draw(threads, &scene, &need)?.framebuffer;
        hold(other.same_bits(&one), || {
            format!("{threads} threads draw another picture than one: {}", first_difference(&other, &one))
        })?;
    }
    Ok(())
}

/// Says where two pictures differ first.
fn first_difference(a: &Framebuffer, b: &Framebuffer) -> String {
    let width = a.width().max(1) as usize;
    let at = |i: usize| format!("pixel ({}, {})", i % width, i / width);
    let bits = |c: &Vec3| c.to_array().map(f32::to_bits);
    let color = a.color().iter().zip(b.color()).position(|(a, b)| bits(a) != bits(b));
    let id = a.id().iter().zip(b.id()).position(|(a, b)| a != b);
    let distance = a.distance().iter().zip(b.distance()).position(|(a, b)| a.to_bits() != b.to_bits());
    match (color, id, distance) {
        (_, Some(i), _) => format!("id at {}", at(i)),
        (_, _, Some(i)) => format!("distance at {}", at(i)),
        (Some(i), ..) => format!("color {} or {} at {}", a.color()[i], b.color()[i], at(i)),
        _ => "in another channel".to_owned(),
    }
}

pub(super) fn second_frame(subject: &Subject) -> Result<(), String> {
    let scene = scene(EVERYTHING)?;
    let need = subject.need(&scene, 40, 30)?;
    let mut studio = subject.studio(2)?;
    let first = studio.draw(&subject.backend, &scene, &need).map_err(|e| e.to_string())?.framebuffer;
    let mut second = Framebuffer::new(40, 30, need.channels);
    studio.render(&subject.backend, &need.frame(), &mut second).map_err(|e| e.to_string())?;
    hold(second.same_bits(&first), || {
        format!("a second frame differs: {}", first_difference(&second, &first))
    })?;
    let anew = studio.draw(&subject.backend, &scene, &need).map_err(|e| e.to_string())?.framebuffer;
    hold(anew.same_bits(&first), || format!("prepared anew it differs: {}", first_difference(&anew, &first)))
}

pub(super) fn after_a_switch(subject: &Subject) -> Result<(), String> {
    let (one, other) = (scene("polyhedra")?, scene("figure")?);
    let mut studio = subject.studio(2)?;
    let mut draw = |scene: &Arc<Scene>, width| -> Result<Framebuffer, String> {
        let need = subject.need(scene, width, 33)?;
        Ok(studio.draw(&subject.backend, scene, &need).map_err(|e| e.to_string())?.framebuffer)
    };
    let before = draw(&one, 47)?;
    draw(&other, 61)?;
    let after = draw(&one, 47)?;
    hold(after.same_bits(&before), || format!("it differs: {}", first_difference(&after, &before)))
}

pub(super) fn sizes(subject: &Subject) -> Result<(), String> {
    let scene = scene("polyhedra")?;
    let mut studio = subject.studio(2)?;
    for (width, height) in [(0, 0), (0, 5), (1, 1), (1, 7), (13, 11), (257, 3), (7680, 2), (3, 4320)] {
        let need = subject.need(&scene, width, height)?;
        let picture = studio.draw(&subject.backend, &scene, &need);
        let picture = picture.map_err(|e| format!("{width}x{height}: {e}"))?.framebuffer;
        hold((picture.width(), picture.height()) == (width, height), || {
            format!("{width}x{height} became {}x{}", picture.width(), picture.height())
        })?;
        let wild = picture.count_not_finite();
        hold(wild == 0, || format!("{width}x{height}: {wild} numbers are not finite"))?;
    }
    Ok(())
}

pub(super) fn channels(subject: &Subject) -> Result<(), String> {
    let scene = scene(EVERYTHING)?;
    let all_needed = subject.need(&scene, 48, 27)?;
    let mut studio = subject.studio(2)?;
    let all = studio.draw(&subject.backend, &scene, &all_needed).map_err(|e| e.to_string())?.framebuffer;
    for channel in Channel::ALL {
        let need = Need { channels: Channels::of(&[channel]), ..all_needed.clone() };
        let alone = studio.draw(&subject.backend, &scene, &need).map_err(|e| e.to_string())?.framebuffer;
        let same = match channel {
            Channel::Color => alone.color() == all.color(),
            Channel::Distance => alone.distance() == all.distance(),
            Channel::Normal => alone.normal() == all.normal(),
            Channel::Id => alone.id() == all.id(),
            Channel::Albedo => alone.albedo() == all.albedo(),
            Channel::Shadow => alone.shadow() == all.shadow(),
            Channel::Coverage => alone.coverage() == all.coverage(),
        };
        hold(same, || format!("{} alone differs from {0} among others", channel.name()))?;
    }
    Ok(())
}

/// Marks a number that nobody computes.
const MARK: f32 = f32::from_bits(0x7fc0_dead);

fn mark(band: &mut Band<'_>) {
    let all = Vec3::splat(MARK);
    band.color.fill(all);
    band.distance.fill(MARK);
    band.normal.fill(all);
    band.id.fill(u32::MAX);
    band.albedo.fill(all);
    band.shadow.fill(MARK);
    band.coverage.fill(MARK);
}

pub(super) fn every_pixel(subject: &Subject) -> Result<(), String> {
    let scene = scene("polyhedra")?;
    let info = subject.registry.info(&subject.backend).map_err(|e| e.to_string())?;
    let mut need = subject.need(&scene, 53, 31)?;
    need.channels = info.channels;
    let mut studio = subject.studio(2)?;
    let mut picture = studio.draw(&subject.backend, &scene, &need).map_err(|e| e.to_string())?.framebuffer;
    mark(&mut picture.band());
    studio.render(&subject.backend, &need.frame(), &mut picture).map_err(|e| e.to_string())?;
    let marked = |v: &&f32| v.to_bits() == MARK.to_bits();
    let marked3 = |v: &&Vec3| v.to_array().iter().any(|c| c.to_bits() == MARK.to_bits());
    for (channel, left) in [
        (Channel::Color, picture.color().iter().filter(marked3).count()),
        (Channel::Distance, picture.distance().iter().filter(marked).count()),
        (Channel::Normal, picture.normal().iter().filter(marked3).count()),
        (Channel::Id, picture.id().iter().filter(|id| **id == u32::MAX).count()),
        (Channel::Albedo, picture.albedo().iter().filter(marked3).count()),
        (Channel::Shadow, picture.shadow().iter().filter(marked).count()),
        (Channel::Coverage, picture.coverage().iter().filter(marked).count()),
    ] {
        hold(left == 0, || format!("{left} of {} pixels of {} are not written", 53 * 31, channel.name()))?;
    }
    Ok(())
}

pub(super) fn accounts(subject: &Subject) -> Result<(), String> {
    let mut scene = (*scene(EVERYTHING)?).clone();
    scene.objects[1].visible = false;
    scene.objects[2].world_from_object = DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0));
    let scene = Arc::new(scene);
    let need = subject.need(&scene, 32, 18)?;
    let mut studio = subject.studio(1)?;
    let drawing = studio.draw(&subject.backend, &scene, &need).map_err(|e| e.to_string())?;
    let (done, prepared) = (&drawing.report.objects, &drawing.prepared.objects);
    hold(done.len() == scene.objects.len(), || {
        format!("{} decisions for {} objects", done.len(), scene.objects.len())
    })?;
    hold(done == prepared, || "`render` reports something else than `prepare`".to_owned())?;
    for (object, decision) in scene.objects.iter().zip(done.iter()) {
        let name = &object.name;
        hold(!decision.why().contains("does not say how"), || format!("`{name}`: {}", decision.why()))?;
        hold(decision.word() == "exact" || !decision.why().is_empty(), || {
            format!("`{name}` is {} without a reason", decision.word())
        })?;
    }
    for index in [1, 2] {
        let (name, word) = (&scene.objects[index].name, done[index].word());
        hold(word == "skipped", || format!("`{name}` cannot be drawn and is said to be {word}"))?;
    }
    let plan = studio.renderer(&subject.backend).map_err(|e| e.to_string())?.plan(&scene, &need);
    for (planned, done) in plan.objects.iter().zip(done.iter()) {
        let (plan, word, name) = (planned.decision.word(), done.word(), &planned.name);
        hold(plan == word, || format!("`{name}` is planned to be {plan} and then is {word}"))?;
    }
    hold(plan.objects.len() == done.len(), || format!("{} objects are planned", plan.objects.len()))
}

pub(super) fn required(subject: &Subject) -> Result<(), String> {
    let mut scene = (*scene("polyhedra")?).clone();
    scene.objects[0].required = true;
    scene.objects[0].world_from_object = DAffine3::from_scale(DVec3::ZERO);
    let scene = Arc::new(scene);
    match subject.draw(1, &scene, &subject.need(&scene, 8, 8)?) {
        Ok(_) => Err("a required object without extent was passed over".to_owned()),
        Err(line) if line.contains(&scene.objects[0].name) && line.contains("required") => Ok(()),
        Err(line) => Err(format!("the error does not name the required object: {line}")),
    }
}

/// Tells whether anything at all is drawn; a template draws nothing, and says so.
pub(super) fn draws(drawing: &crate::Drawing) -> bool {
    drawing.prepared.objects.iter().any(|d| d.word() != "skipped")
}

pub(super) fn projections(subject: &Subject) -> Result<(), String> {
    let scene = scene(EVERYTHING)?;
    let mut studio = subject.studio(2)?;
    for projection in [
        Projection::Orthographic { height: 4.0 },
        Projection::Fisheye { fov: 3.0 },
        Projection::Cylindrical { fov_x: 3.0, fov_y: 1.0 },
    ] {
        let mut need = subject.need(&scene, 48, 40)?;
        need.camera.projection = projection.clone();
        let drawing = studio.draw(&subject.backend, &scene, &need).map_err(|e| e.to_string())?;
        let picture = &drawing.framebuffer;
        let wild = picture.count_not_finite();
        hold(wild == 0, || format!("{projection:?}: {wild} numbers are not finite"))?;
        let seen = picture.id().iter().filter(|&&id| id != 0).count();
        hold(seen > 48 * 40 / 4 || !draws(&drawing), || {
            format!("{projection:?}: {seen} pixels see an object")
        })?;
    }
    Ok(())
}

pub(super) fn empty_scene(subject: &Subject) -> Result<(), String> {
    let scene = Arc::new(Scene::default());
    let camera = Camera::framing(&scene.bounds(), 0.0, 0.0, 1.0, Projection::Perspective { fov_y: 1.0 });
    let need = Need { channels: Channels::ALL, ..Need::new(camera, 9, 9) };
    let picture = subject.draw(1, &scene, &need)?.framebuffer;
    let ray = need.camera.view(9, 9).ray(4.5, 4.5).ok_or("a camera without rays")?;
    let (color, wanted) = (picture.color()[40], scene.environment.background.color(ray.direction));
    hold((color - wanted).length() < 1e-6, || format!("the background is {color}, not {wanted}"))?;
    hold(picture.distance().iter().all(|d| *d == f32::INFINITY), || "nothing has a distance".to_owned())?;
    hold(picture.id().iter().all(|&id| id == 0), || "nothing has an id".to_owned())
}
