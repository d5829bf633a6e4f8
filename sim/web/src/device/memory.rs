//! A motor's records, model and compensator in memory. The page gets each file as soon as it is complete.

use rotorlead_device::{Header, Keeper, free_name};
use rotorlead_records::files::FilesInMemory;
use rotorlead_records::{Experiment, Record};
use serde_json::json;

use super::port::say;

/// Where the files of one motor are.
pub struct MotorInMemory {
    name: String,
    experiment: Experiment,
    files: FilesInMemory,
}

impl MotorInMemory {
    /// Without records.
    pub fn new(motor: u8, header: Header) -> Self {
        Self { name: format!("motor{motor}"), experiment: header.experiment, files: FilesInMemory::new() }
    }

    fn keep(&mut self, name: &str, text: Vec<u8>) {
        say(&json!({ "file": format!("{}/{name}", self.name), "text": String::from_utf8_lossy(&text) }));
        self.files.insert(name.to_owned(), text);
    }
}

impl Keeper for MotorInMemory {
    fn place(&self) -> String {
        self.name.clone()
    }

    fn add(&mut self, stem: &str, mut record: Record) -> miette::Result<String> {
        record.file = free_name(stem, ".csv", |name| self.files.contains_key(name));
        // No motor is tuned through a compensator.
        record.compensator = None;
        let file = record.file.clone();
        let mut experiment = self.experiment.clone();
        experiment.records.push(record);
        for (name, text) in experiment.files()? {
            if self.files.get(&name) != Some(&text) {
                self.keep(&name, text);
            }
        }
        self.experiment = experiment;
        Ok(file)
    }

    fn experiment(&self) -> miette::Result<Experiment> {
        Ok(self.experiment.clone())
    }

    fn checksum(&self) -> Option<String> {
        Experiment::checksum_in((&self.files).into())
    }

    fn write(&mut self, name: &str, text: &str) -> miette::Result<()> {
        self.keep(name, text.as_bytes().to_vec());
        Ok(())
    }
}
