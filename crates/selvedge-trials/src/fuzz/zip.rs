//! ZIP archives, as NumPy makes them of arrays.

/// A ZIP archive of these names and contents, not packed.
pub(super) fn zip(entries: &[(Vec<u8>, Vec<u8>)]) -> Vec<u8> {
    let number = |n: usize| (n as u32).to_le_bytes();
    let (mut file, mut directory) = (Vec::new(), Vec::new());
    for (name, data) in entries {
        let mut common = [20, 0, 0, 0, 0, 0, 0, 0, 0x21, 0].to_vec();
        common.extend(crc32fast::hash(data).to_le_bytes());
        common.extend([number(data.len()), number(data.len())].concat());
        common.extend((name.len() as u16).to_le_bytes());
        common.extend([0, 0]);
        directory.extend([b"PK\x01\x02\x14\0", &common[..], &[0; 10]].concat());
        directory.extend([&number(file.len())[..], name].concat());
        file.extend([b"PK\x03\x04", &common[..], name, data].concat());
    }
    let start = file.len();
    let count = (entries.len() as u16).to_le_bytes();
    file.extend(&directory);
    file.extend([b"PK\x05\x06\0\0\0\0", &count[..], &count].concat());
    file.extend([number(directory.len()), number(start)].concat());
    file.extend([0, 0]);
    file
}
