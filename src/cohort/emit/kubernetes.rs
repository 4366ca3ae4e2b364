//! An Indexed Job of Kubernetes, one index a subject.

use super::{CORES, NOTICE, STOPPED, job_name};
use crate::cohort::Manifest;

/// Where the volume with manifest, data and results is in the container.
const MOUNT: &str = "/work";

/// A manifest for `kubectl apply`: each index is one subject; a pod that is evicted, or says that it stopped, is started again without
/// counting as a failure, a subject that fails stops no other. The image is that of the Dockerfile; the volume claim `avatars` has to hold
/// the manifest.
pub fn kubernetes_job(manifest: &Manifest) -> String {
    let (name, count) = (job_name(&manifest.path), manifest.subjects.len());
    let file = manifest.path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let path = serde_json::Value::from(format!("{MOUNT}/{file}"));
    format!(
        r#"apiVersion: batch/v1
kind: Job
metadata:
  name: {name}
spec:
  completionMode: Indexed
  completions: {count}
  parallelism: {count}
  backoffLimitPerIndex: 1
  podFailurePolicy:
    rules:
      # Stopped, with the training saved: gone on with by the next pod.
      - action: Ignore
        onExitCodes:
          containerName: xavatar
          operator: In
          values: [{STOPPED}]
      - action: Ignore
        onPodConditions:
          - type: DisruptionTarget
            status: "True"
      # The subject's data or settings: another try would end alike.
      - action: FailIndex
        onExitCodes:
          containerName: xavatar
          operator: In
          values: [1, 2]
  template:
    spec:
      restartPolicy: Never
      terminationGracePeriodSeconds: {NOTICE}
      containers:
        - name: xavatar
          image: xavatar:{version}
          # JOB_COMPLETION_INDEX says which subject.
          args: ["--threads", "{CORES}", "batch", {path}]
          resources:
            requests:
              cpu: "{CORES}"
              memory: 8Gi
            limits:
              memory: 8Gi
          volumeMounts:
            - name: avatars
              mountPath: {MOUNT}
      volumes:
        - name: avatars
          persistentVolumeClaim:
            claimName: avatars
"#,
        version = env!("CARGO_PKG_VERSION"),
    )
}
