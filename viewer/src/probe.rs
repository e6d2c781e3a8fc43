//! What do the back ends say of one place of the picture?

use polyptych::framebuffer::{Channel, Framebuffer};
use polyptych::picture::displayed;
use polyptych::scene::Scene;

/// Returns the id of what a picture shows at a place, if it has ids and shows something there.
pub(crate) fn id_at(picture: &Framebuffer, place: [f32; 2]) -> Option<u32> {
    picture.id().get(index(picture, place)).copied().filter(|id| *id != 0)
}

/// Returns the index of the pixel at a place, given as shares of width and height.
fn index(picture: &Framebuffer, place: [f32; 2]) -> usize {
    let [x, y] = [(place[0], picture.width()), (place[1], picture.height())]
        .map(|(share, size)| ((share * size as f32) as u32).min(size.saturating_sub(1)));
    y as usize * picture.width() as usize + x as usize
}

/// Returns the values of all channels that a picture has at a place, given as shares of its width and height.
pub(crate) fn values(picture: &Framebuffer, scene: &Scene, place: [f32; 2]) -> Vec<(Channel, String)> {
    let at = index(picture, place);
    let vector = |v: glam::Vec3| format!("{:.3} {:.3} {:.3}", v.x, v.y, v.z);
    let of = |channel: Channel| -> Option<String> {
        Some(match channel {
            Channel::Color => {
                let [r, g, b] = *displayed(picture, channel).get(at)?;
                format!("{} (#{r:02x}{g:02x}{b:02x})", vector(*picture.color().get(at)?))
            }
            Channel::Distance => format!("{:.5} m", picture.distance().get(at)?),
            Channel::Normal => vector(*picture.normal().get(at)?),
            Channel::Id => match *picture.id().get(at)? {
                0 => "nothing".to_owned(),
                id => scene.objects.get(id as usize - 1).map_or(format!("{id}"), |o| o.name.clone()),
            },
            Channel::Albedo => vector(*picture.albedo().get(at)?),
            Channel::Shadow => format!("{:.2}", picture.shadow().get(at)?),
            Channel::Coverage => format!("{:.2}", picture.coverage().get(at)?),
        })
    };
    Channel::ALL.into_iter().filter_map(|channel| Some((channel, of(channel)?))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use polyptych::framebuffer::{Channels, Pixel};

    #[test]
    fn the_values_are_those_of_the_pixel_under_the_place() {
        let scene = polyptych::builtin::scene("polyhedra").unwrap();
        let mut picture = Framebuffer::new(4, 2, Channels::of(&[Channel::Distance, Channel::Id]));
        let pixel = Pixel { distance: 2.5, id: 1, ..Pixel::background(Vec3::ZERO) };
        picture.band().put(3, 1, &pixel);
        let name = scene.objects[0].name.clone();
        assert_eq!(
            values(&picture, &scene, [0.99, 0.99]),
            [(Channel::Distance, "2.50000 m".to_owned()), (Channel::Id, name)]
        );
        assert_eq!(values(&picture, &scene, [1.0, 1.0]).len(), 2);
        assert_eq!(values(&picture, &scene, [0.0, 0.0])[1].1, "nothing");
        assert!(values(&Framebuffer::new(0, 0, Channels::ALL), &scene, [0.5, 0.5]).is_empty());
    }
}
