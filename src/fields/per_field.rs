//! One thing for each of the three fields.

/// Something of geometry, of texture and of skinning.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PerField<T> {
    /// Of the geometry field.
    pub geometry: T,
    /// Of the texture field.
    pub texture: T,
    /// Of the skinning field.
    pub skinning: T,
}

impl<T> PerField<T> {
    /// The three with their fields' names, as checkpoints and avatar files prefix their tensors.
    pub fn named(self) -> [(&'static str, T); 3] {
        [("geometry", self.geometry), ("texture", self.texture), ("skinning", self.skinning)]
    }

    /// References to the three.
    pub fn as_ref(&self) -> PerField<&T> {
        PerField { geometry: &self.geometry, texture: &self.texture, skinning: &self.skinning }
    }

    /// References to the three, to change them.
    pub fn as_mut(&mut self) -> PerField<&mut T> {
        PerField { geometry: &mut self.geometry, texture: &mut self.texture, skinning: &mut self.skinning }
    }

    /// What `change` makes of each.
    pub fn map<U>(self, mut change: impl FnMut(T) -> U) -> PerField<U> {
        PerField { geometry: change(self.geometry), texture: change(self.texture), skinning: change(self.skinning) }
    }
}
