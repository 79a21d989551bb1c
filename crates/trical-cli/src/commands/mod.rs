//! One file a command.

pub mod compare;
pub mod compensate;
pub mod completions;
pub mod convert;
pub mod demo;
pub mod demo_report;
pub mod diagnose;
pub mod effects;
pub mod export;
pub mod gauge;
pub mod guided;
pub mod history;
pub mod identify;
pub mod init;
pub mod measure;
pub mod plan;
pub mod record;
pub mod repeatability;
pub mod robot;
pub mod sample;
pub mod study;
pub mod validate;
pub mod virtual_cell;
