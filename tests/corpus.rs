//! The corpus of the fuzz targets (`fuzz/corpus/`, a folder for each reader of what comes from outside), replayed.
//!
//! A name says what must happen: `refused-...` is refused, `any-...` must only not panic, and all others are taken.

#[path = "../fuzz/src/lib.rs"]
mod fuzz;

use std::collections::BTreeSet;
use std::path::Path;
use std::time::{Duration, Instant};

/// Larger files make a slow corpus.
const LARGEST: u64 = 16 << 10;

fn corpus() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus")
}

#[test]
fn every_file_of_the_corpus_is_taken_or_refused_as_its_name_says() {
    let mut wrong = Vec::new();
    for (name, target) in fuzz::TARGETS {
        let folder = corpus().join(name);
        let mut files: Vec<_> = std::fs::read_dir(&folder)
            .unwrap_or_else(|e| panic!("{}: {e}; every target has a corpus", folder.display()))
            .map(|f| f.unwrap().path())
            .collect();
        files.sort();
        let [mut taken, mut refused] = [0_u32; 2];
        for file in files {
            let name = file.file_name().unwrap().to_str().unwrap().to_owned();
            let bytes = std::fs::read(&file).unwrap();
            assert!(bytes.len() as u64 <= LARGEST, "{}: {} bytes", file.display(), bytes.len());
            // a panic says which file it was
            eprintln!("{}", file.display());
            let begin = Instant::now();
            let was_taken = target(&bytes);
            assert!(begin.elapsed() < Duration::from_secs(10), "{}: {:?}", file.display(), begin.elapsed());
            let expected = (!name.starts_with("any-")).then(|| !name.starts_with("refused-"));
            if expected.is_some_and(|e| e != was_taken) {
                wrong.push(format!("{} was {}", file.display(), if was_taken { "taken" } else { "refused" }));
            }
            taken += u32::from(expected == Some(true));
            refused += u32::from(expected == Some(false));
        }
        assert!(taken >= 2 && refused >= 1, "{name}: {taken} files to take, {refused} to refuse");
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn every_target_is_a_program_of_the_fuzz_package_with_a_folder_and_no_other_is() {
    let names: BTreeSet<String> = fuzz::TARGETS.iter().map(|t| t.0.to_owned()).collect();
    let in_folder = |folder: &str| -> BTreeSet<String> {
        let entries = std::fs::read_dir(corpus().join("..").join(folder)).unwrap();
        entries.map(|e| e.unwrap().path().file_stem().unwrap().to_str().unwrap().to_owned()).collect()
    };
    assert_eq!(names, in_folder("corpus"));
    assert_eq!(names, in_folder("fuzz_targets"));
    let manifest = std::fs::read_to_string(corpus().join("../Cargo.toml")).unwrap();
    for name in &names {
        assert!(manifest.contains(&format!("name = \"{name}\"\npath = \"fuzz_targets/{name}.rs\"")), "{name}");
        let program = std::fs::read_to_string(corpus().join(format!("../fuzz_targets/{name}.rs"))).unwrap();
        assert_eq!(program.matches("trical_fuzz::").count(), 1, "{name}");
    }
}
