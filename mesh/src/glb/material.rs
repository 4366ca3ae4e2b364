//! Materials of a GLB: which picture or colour the faces of each have.

use std::borrow::Cow;
use std::collections::{BTreeSet, HashMap};
use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use glam::Vec2;
use image::{ImageFormat, RgbImage};

use super::container::Container;
use super::document::{Image, Material, Surface, TextureTransform, TextureUse};
use crate::draft::Paint;
use crate::texture::{Pictures, find_referenced};
use xavatar_formats::{Error, Fault, PICTURE_FORMATS, Result, decode_picture, excerpt, read_bytes};

/// The materials of a file, each opened when it is asked for.
pub(super) struct Materials<'a> {
    path: &'a Path,
    container: &'a Container<'a>,
    pub(super) pictures: Pictures,
    opened: HashMap<usize, Coat>,
    /// The picture of each texture and factor.
    tinted: HashMap<(usize, [u32; 3]), u32>,
    /// The pictures that are not there.
    pub(super) missing: BTreeSet<String>,
    /// What is wrong with others.
    pub(super) unread: BTreeSet<String>,
}

/// Where faces have their colour from.
#[derive(Clone, Copy)]
pub(super) struct Coat {
    pub(super) paint: Paint,
    /// Which set of texture coordinates.
    pub(super) coordinates: usize,
    pub(super) transform: Option<TextureTransform>,
}

impl Coat {
    fn new(paint: Paint) -> Self {
        Self { paint, coordinates: 0, transform: None }
    }
}

impl<'a> Materials<'a> {
    pub(super) fn new(path: &'a Path, container: &'a Container<'a>) -> Self {
        Self {
            path,
            container,
            pictures: Pictures::default(),
            opened: HashMap::new(),
            tinted: HashMap::new(),
            missing: BTreeSet::new(),
            unread: BTreeSet::new(),
        }
    }

    /// The coat of faces of a material, or of none.
    pub(super) fn coat(&mut self, material: Option<usize>) -> Result<Coat> {
        let Some(index) = material else { return Ok(Coat::new(Paint::Vertices)) };
        if let Some(coat) = self.opened.get(&index) {
            return Ok(*coat);
        }
        let materials = &self.container.document.materials;
        let material = materials.get(index).ok_or_else(|| {
            self.malformed(format!("material {index}"), "missing", &format!("one of {}", materials.len()))
        })?;
        let coat = self.open(material)?;
        self.opened.insert(index, coat);
        Ok(coat)
    }

    fn open(&mut self, material: &Material) -> Result<Coat> {
        let surface = material.extensions.specular_glossiness.as_ref().unwrap_or(&material.pbr_metallic_roughness);
        let factor = factor_of(surface);
        let Some(texture) = &surface.base_color_texture else {
            let is_white = factor.iter().all(|channel| *channel >= 1.0);
            return Ok(Coat::new(if is_white { Paint::Vertices } else { Paint::Plain(factor.map(encoded)) }));
        };
        let factor = if self.container.document.is_of_trimesh() { [1.0; 3] } else { factor };
        let Some(picture) = self.tinted(texture, factor)? else { return Ok(Coat::new(Paint::Vertices)) };
        let transform = texture.extensions.transform;
        let coordinates = transform.and_then(|transform| transform.tex_coord).unwrap_or(texture.tex_coord);
        Ok(Coat { paint: Paint::Picture(picture), coordinates, transform })
    }

    /// The picture of a texture, its light multiplied by a factor.
    fn tinted(&mut self, texture: &TextureUse, factor: [f32; 3]) -> Result<Option<u32>> {
        let key = (texture.index, factor.map(f32::to_bits));
        if let Some(picture) = self.tinted.get(&key) {
            return Ok(Some(*picture));
        }
        let Some(mut picture) = self.read(texture)? else { return Ok(None) };
        if factor.iter().any(|channel| *channel < 1.0) {
            let table = |factor| std::array::from_fn::<u8, 256, _>(|byte| encoded(factor * decoded(byte as u8)));
            let tables = factor.map(table);
            picture.pixels_mut().for_each(|texel| {
                texel.0 = std::array::from_fn(|channel| tables[channel][usize::from(texel.0[channel])]);
            });
        }
        let place = self.pictures.add(self.path, picture)?;
        self.tinted.insert(key, place);
        Ok(Some(place))
    }

    /// The picture of a texture, whose first row is v = 0; `None`, with the reason noted, if it is of another kind or elsewhere.
    fn read(&mut self, texture: &TextureUse) -> Result<Option<RgbImage>> {
        let document = &self.container.document;
        let Some(found) = document.textures.get(texture.index) else {
            return Err(self.malformed(format!("texture {}", texture.index), "missing", "one that there is"));
        };
        let Some(source) = found.source else {
            let kind = found.extensions.keys().next().map_or("without a picture".into(), |name| excerpt(name));
            self.unread.insert(format!("texture {} is {kind}; export it as PNG or JPEG", texture.index));
            return Ok(None);
        };
        let Some(image) = document.images.get(source) else {
            return Err(self.malformed(format!("image {source}"), "missing", "one that there is"));
        };
        let Some(bytes) = self.bytes_of(source, image)? else { return Ok(None) };
        let named = image.mime_type.as_deref().and_then(ImageFormat::from_mime_type);
        match decode_picture(&bytes, named) {
            Ok(picture) => Ok(Some(picture.into_rgb8())),
            Err(found) => Err(self.malformed(format!("image {source}"), &found, PICTURE_FORMATS)),
        }
    }

    /// What an image is decoded from: a part of the file, base64 in its JSON, or a file beside it, which may be missing.
    fn bytes_of(&mut self, index: usize, image: &Image) -> Result<Option<Cow<'a, [u8]>>> {
        if let Some(view) = image.buffer_view {
            let (bytes, _) = self.container.view(view).map_err(|fault| fault.in_file(self.path, "GLB"))?;
            return Ok(Some(bytes.into()));
        }
        let uri = image.uri.as_deref().unwrap_or_default();
        if let Some((_, encoded)) = uri.strip_prefix("data:").and_then(|data| data.split_once(";base64,")) {
            let bytes = STANDARD.decode(encoded);
            let bytes = bytes.map_err(|error| self.malformed(format!("image {index}"), &error.to_string(), "base64"));
            return Ok(Some(bytes?.into()));
        }
        let Some(file) = find_referenced(self.path, uri) else {
            self.missing.insert(uri.to_owned());
            return Ok(None);
        };
        Ok(Some(read_bytes(&file)?.into()))
    }

    fn malformed(&self, place: String, found: &str, expected: &str) -> Error {
        Fault::malformed(place, found, expected).in_file(self.path, "GLB")
    }
}

impl TextureTransform {
    /// Where a texture coordinate is looked up.
    pub(super) fn apply(&self, uv: Vec2) -> Vec2 {
        let scaled = uv * Vec2::from(self.scale);
        let (sine, cosine) = self.rotation.sin_cos();
        Vec2::from(self.offset) + Vec2::new(cosine * scaled.x - sine * scaled.y, sine * scaled.x + cosine * scaled.y)
    }
}

/// Linear red, green and blue, in [0, 1].
fn factor_of(surface: &Surface) -> [f32; 3] {
    let [red, green, blue, _alpha] = surface.base_color_factor.unwrap_or([1.0; 4]);
    [red, green, blue].map(|channel| channel.clamp(0.0, 1.0))
}

/// A linear channel in [0, 1] as an sRGB byte (IEC 61966-2-1).
pub(super) fn encoded(linear: f32) -> u8 {
    let share = if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
    (share * 255.0).round() as u8
}

/// The linear channel of an sRGB byte.
fn decoded(byte: u8) -> f32 {
    let share = f32::from(byte) / 255.0;
    if share <= 0.04045 { share / 12.92 } else { ((share + 0.055) / 1.055).powf(2.4) }
}
