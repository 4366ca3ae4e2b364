//! The faces of a PLY file: polygons, and strips of triangles.

use glam::Vec2;

use super::body::Body;
use super::header::{Element, Layout};
use crate::Parsed;
use crate::colours::byte_colours;
use xavatar_formats::Fault;

/// F triangles, and what the file says of them beside their corners.
#[derive(Default)]
pub(super) struct Faces {
    pub(super) triangles: Vec<[u32; 3]>,
    /// Texture coordinates of the corners (F, 3), if the file has any; not finite for faces without.
    pub(super) uvs: Option<Vec<[Vec2; 3]>>,
    /// The picture of each (F) by its place among the texture files, if the file says.
    pub(super) pictures: Option<Vec<u32>>,
    /// Colours (F), if the file has any, where they are known.
    pub(super) colours: Option<Vec<Option<[u8; 3]>>>,
    /// Rows of less than three corners.
    pub(super) degenerate: usize,
}

/// The texture coordinates of a face without.
const NOWHERE: [Vec2; 3] = [Vec2::NAN; 3];

impl Faces {
    /// Adds the rows of an element `face`: polygons, each as the fan of triangles around its first corner.
    pub(super) fn read_polygons(element: &Element, body: &mut Body) -> Parsed<Self> {
        let indices = index_list(element)?;
        let texcoord = element.property("texcoord");
        let texnumber = element.scalar("texnumber");
        let colour = element.colour();
        let mut faces = Self {
            triangles: Vec::with_capacity(element.count),
            uvs: texcoord.map(|_| Vec::with_capacity(element.count)),
            pictures: texnumber.map(|_| Vec::with_capacity(element.count)),
            ..Self::default()
        };
        let mut colours = Vec::new();
        let (mut corners, mut coordinates) = (Vec::new(), Vec::new());
        let mut row = vec![0.0; element.properties.len()];
        for _ in 0..element.count {
            body.next_row();
            for (place, property) in element.properties.iter().enumerate() {
                match property.layout {
                    Layout::Scalar(scalar) => row[place] = body.number(scalar)?,
                    Layout::List { count, item } if place == indices => body.list(count, item, &mut corners)?,
                    Layout::List { count, item } if Some(place) == texcoord => {
                        body.list(count, item, &mut coordinates)?;
                    }
                    list => body.skip(list)?,
                }
            }
            let before = faces.triangles.len();
            faces.add_polygon(&corners, body)?;
            let added = faces.triangles.len() - before;
            if let Some(uvs) = &mut faces.uvs {
                uvs.extend((0..added).map(|triangle| fan_coordinates(&coordinates, corners.len(), triangle)));
            }
            if let (Some(pictures), Some(column)) = (&mut faces.pictures, texnumber) {
                // None has the number -1.
                let picture = u32::try_from(row[column] as i64).unwrap_or(u32::MAX);
                pictures.extend(std::iter::repeat_n(picture, added));
            }
            if let Some(columns) = colour {
                colours.extend(std::iter::repeat_n(columns.map(|column| row[column] as f32), added));
            }
        }
        faces.colours = colour.map(|columns| byte_colours(&colours, element.are_integers(columns)));
        Ok(faces)
    }

    /// Adds the rows of an element `tristrips`: each vertex makes a triangle with the two before it, and every other one is turned
    /// over; -1 begins another strip. Triangles of two equal corners only lead on to the next.
    pub(super) fn read_strips(element: &Element, body: &mut Body) -> Parsed<Self> {
        let indices = index_list(element)?;
        let (mut triangles, mut strips) = (Vec::new(), Vec::new());
        for _ in 0..element.count {
            body.next_row();
            for (place, property) in element.properties.iter().enumerate() {
                match property.layout {
                    Layout::List { count, item } if place == indices => body.list(count, item, &mut strips)?,
                    other => body.skip(other)?,
                }
            }
            for strip in strips.split(|index| *index == -1.0) {
                let strip = strip.iter().map(|index| vertex_index(*index, body)).collect::<Parsed<Vec<u32>>>()?;
                triangles.extend(strip.windows(3).enumerate().filter_map(|(place, corners)| {
                    let [a, b, c] = *corners else { return None };
                    let is_triangle = a != b && b != c && c != a;
                    is_triangle.then_some(if place % 2 == 0 { [a, b, c] } else { [b, a, c] })
                }));
            }
        }
        Ok(Self { triangles, ..Self::default() })
    }

    /// All triangles of both.
    pub(super) fn and(mut self, other: Self) -> Self {
        let (here, there) = (self.triangles.len(), other.triangles.len());
        self.triangles.extend(other.triangles);
        self.uvs = joined((self.uvs, here), (other.uvs, there), NOWHERE);
        self.pictures = joined((self.pictures, here), (other.pictures, there), 0);
        self.colours = joined((self.colours, here), (other.colours, there), None);
        self.degenerate += other.degenerate;
        self
    }

    fn add_polygon(&mut self, corners: &[f64], body: &Body) -> Parsed<()> {
        self.degenerate += usize::from(corners.len() < 3);
        let [first, rest @ ..] = corners else { return Ok(()) };
        for pair in rest.windows(2) {
            let mut triangle = [0; 3];
            for (corner, index) in triangle.iter_mut().zip([*first, pair[0], pair[1]]) {
                *corner = vertex_index(index, body)?;
            }
            self.triangles.push(triangle);
        }
        Ok(())
    }
}

/// The values of both, of which one has `here` and the other `there`; a default for those of the one without.
fn joined<T: Clone>(
    (first, here): (Option<Vec<T>>, usize),
    (second, there): (Option<Vec<T>>, usize),
    default: T,
) -> Option<Vec<T>> {
    if first.is_none() && second.is_none() {
        return None;
    }
    let mut values = first.unwrap_or_else(|| vec![default.clone(); here]);
    values.extend(second.unwrap_or_else(|| vec![default; there]));
    Some(values)
}

/// The place of the list of vertices.
fn index_list(element: &Element) -> Parsed<usize> {
    let place = ["vertex_indices", "vertex_index"].into_iter().find_map(|name| element.property(name));
    let kind = |place: usize| match element.properties[place].layout {
        Layout::List { item, .. } if item.is_integer() => Some(place),
        _ => None,
    };
    place.and_then(kind).ok_or_else(|| {
        let expected = "a list of integers, `vertex_indices` or `vertex_index`";
        Fault::malformed(format!("element {}", element.name), "without vertex indices", expected)
    })
}

fn vertex_index(index: f64, body: &Body) -> Parsed<u32> {
    if (0.0..=f64::from(u32::MAX)).contains(&index) {
        return Ok(index as u32);
    }
    Err(Fault::malformed(body.row_place(), format!("vertex index {index}"), "zero or more"))
}

/// The coordinates of one triangle of a polygon's fan.
fn fan_coordinates(coordinates: &[f64], corners: usize, triangle: usize) -> [Vec2; 3] {
    let pairs = coordinates.as_chunks::<2>().0;
    if coordinates.len() != 2 * corners {
        return NOWHERE;
    }
    [0, triangle + 1, triangle + 2].map(|corner| Vec2::from(pairs[corner].map(|value| value as f32)))
}
