//! Files of Zeiss's microscopes after their description, in compound files as the crate cfb writes them.

use std::io::{Cursor, Write as _};

pub(crate) type Fields<'a> = &'a [(&'a str, Vec<u8>)];

pub(crate) fn number(n: u32) -> Vec<u8> {
    n.to_le_bytes().to_vec()
}

/// `fields` besides sizes; each image by its number, from 1 on.
pub(crate) fn written(version: cfb::Version, size: [u32; 2], images: &[Vec<u8>], fields: Fields<'_>) -> Vec<u8> {
    let mut file = cfb::CompoundFile::create_with_version(version, Cursor::new(Vec::new())).unwrap();
    file.create_storage("/ImageInfo").unwrap();
    let count = number(images.len() as u32);
    let sizes = [("ImageWidth", number(size[0])), ("ImageHeight", number(size[1])), ("NoOfImages", count)];
    for (name, value) in sizes.iter().chain(fields) {
        file.create_stream(format!("/ImageInfo/{name}")).unwrap().write_all(value).unwrap();
    }
    for (i, image) in (1..).zip(images) {
        let folder = format!("/ImageData{}", (i as u32).div_ceil(100));
        if !file.is_storage(&folder) {
            file.create_storage(&folder).unwrap();
        }
        file.create_stream(format!("{folder}/Image{i}")).unwrap().write_all(image).unwrap();
    }
    file.into_inner().into_inner()
}
