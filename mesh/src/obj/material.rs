//! MTL files: the picture or the colour of each material.

use std::collections::BTreeMap;

use glam::Vec2;

use super::parse::statement;
use crate::text::numbered_lines;

/// What a material says of its colour.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Material {
    /// Of `map_Kd`, else of `map_Ka`, by which some name the same picture.
    pub(super) texture: Option<Texture>,
    /// `Kd`.
    pub(super) diffuse: Option<[f32; 3]>,
}

/// A picture, and where its texture coordinates are looked up: at uv * scale + offset.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Texture {
    pub(super) file: String,
    pub(super) scale: Vec2,
    pub(super) offset: Vec2,
}

/// The materials of an MTL file by their names. What is not understood is passed over.
pub(super) fn parse_mtl(text: &str) -> BTreeMap<String, Material> {
    let mut materials: BTreeMap<String, Material> = BTreeMap::new();
    let mut name = String::new();
    for (_, line) in numbered_lines(text) {
        let (keyword, rest) = statement(&line);
        let keyword = keyword.to_ascii_lowercase();
        if keyword == "newmtl" {
            name = rest.to_owned();
            materials.entry(name.clone()).or_default();
            continue;
        }
        let Some(material) = materials.get_mut(&name) else { continue };
        match keyword.as_str() {
            "map_kd" => material.texture = texture(rest),
            "map_ka" if material.texture.is_none() => material.texture = texture(rest),
            "kd" => material.diffuse = colour(rest),
            _ => {}
        }
    }
    materials
}

fn colour(rest: &str) -> Option<[f32; 3]> {
    let channels: Vec<f32> = rest.split_ascii_whitespace().map_while(|word| word.parse().ok()).collect();
    channels.get(..3)?.try_into().ok()
}

/// `[-option values] file`, where the file's name may have blanks.
fn texture(rest: &str) -> Option<Texture> {
    let mut texture = Texture { file: String::new(), scale: Vec2::ONE, offset: Vec2::ZERO };
    let mut rest = rest;
    while let Some(option) = rest.strip_prefix('-') {
        let (name, values) = statement(option);
        let (fewest, most) = match name {
            "o" | "s" | "t" => (1, 3),
            "mm" => (2, 2),
            _ => (1, 1),
        };
        let mut numbers = Vec::new();
        rest = values;
        for place in 0..most {
            let (word, after) = statement(rest);
            let number: Option<f32> = word.parse().ok();
            if place >= fewest && number.is_none() {
                break;
            }
            numbers.extend(number);
            rest = after;
        }
        let pair = |default: f32| {
            Vec2::new(numbers.first().copied().unwrap_or(default), numbers.get(1).copied().unwrap_or(default))
        };
        match name {
            "o" => texture.offset = pair(0.0),
            "s" => texture.scale = pair(1.0),
            _ => {}
        }
    }
    texture.file = rest.to_owned();
    Some(texture).filter(|texture| !texture.file.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_and_colours_of_materials_are_read() {
        let text = "Kd 9 9 9\nnewmtl skin of me\nKd 0.5 0.25 0\nmap_Ka dark.png\nmap_Kd my skin.png\nmap_bump b.png\n\
            newmtl b\nmap_Ka only.png\nnewmtl c\nmap_kd -s 2 3 1 -o 0.5 -bm 1.5 -clamp on tex 1.jpg\nnewmtl d\nKd x\nmap_Kd\n";
        let materials = parse_mtl(text);
        let texture = |name: &str| materials[name].texture.clone().map(|t| (t.file, t.scale, t.offset));
        assert_eq!(texture("skin of me"), Some(("my skin.png".into(), Vec2::ONE, Vec2::ZERO)));
        assert_eq!(materials["skin of me"].diffuse, Some([0.5, 0.25, 0.0]));
        assert_eq!(texture("b"), Some(("only.png".into(), Vec2::ONE, Vec2::ZERO)));
        assert_eq!(texture("c"), Some(("tex 1.jpg".into(), Vec2::new(2.0, 3.0), Vec2::new(0.5, 0.0))));
        assert_eq!(materials["d"], Material::default());
    }
}
