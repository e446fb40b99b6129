// A component: a mesh of cloth that is led by the transforms of its handles.
using System;
using System.Threading.Tasks;
using UnityEngine;

namespace Selvedge
{
    /// <summary>A cloth that hangs from transforms. It is made ready on another thread, then moves
    /// at the frame rate of its scene, whatever that of the game is.</summary>
    /// <remarks>Selvedge has right-handed axes with y up, Unity left-handed ones: z is turned
    /// round here, and so are the faces. The object is not to be scaled.</remarks>
    [RequireComponent(typeof(MeshFilter), typeof(MeshRenderer))]
    public sealed class SelvedgeCloth : MonoBehaviour
    {
        [Tooltip("Path of a scene file, or the name of a shipped scene.")]
        public string scene = "default";

        [Tooltip("Path of a model file, or the name of a shipped model; empty for the physics.")]
        public string model = "paper";

        public Guard guard = Guard.Limit;

        [Tooltip("What leads each handle of the scene, in its order; put at the handles first.")]
        public Transform[] handles = new Transform[2];

        [Tooltip("Frames of the cloth in one of the game, at most: a slow game slows the cloth.")]
        public int mostFrames = 4;

        private Task<Stepper> opening;
        private Stepper stepper;
        private Mesh mesh;
        private float[] positions;
        private Vector3[] vertices;
        private double[] before;
        private double[] now;
        private double[] targets;
        private double waiting;

        /// <summary>The stepper, once it is ready; null before.</summary>
        public Stepper Stepper
        {
            get { return stepper; }
        }

        private void OnEnable()
        {
            string sceneName = scene, modelName = model;
            Guard wanted = guard;
            opening = Task.Run(() => Open(sceneName, modelName, wanted));
        }

        private void OnDisable()
        {
            // A cloth that is still being made ready is freed when it is.
            if (opening != null)
                opening.ContinueWith(late =>
                {
                    if (late.Status == TaskStatus.RanToCompletion) late.Result.Dispose();
                });
            opening = null;
            if (stepper != null) stepper.Dispose();
            stepper = null;
            // Unity keeps a mesh until it is destroyed.
            if (mesh != null) Destroy(mesh);
            mesh = null;
        }

        private void Update()
        {
            if (stepper == null && !BeReady()) return;
            double frame = 1.0 / stepper.Counts.FrameRate;
            waiting += Time.deltaTime;
            int steps = (int)Math.Min(Math.Floor(waiting / frame), mostFrames);
            if (steps == 0) return;
            waiting = Math.Min(waiting - steps * frame, frame);
            ReadHandles(now);
            try
            {
                for (int step = 1; step <= steps; step++)
                {
                    for (int k = 0; k < targets.Length; k++)
                        targets[k] = before[k] + (now[k] - before[k]) * step / steps;
                    stepper.Step(targets);
                }
            }
            catch (SelvedgeException error)
            {
                // The cloth is where it was before the step.
                Fail(error);
                return;
            }
            Array.Copy(now, before, now.Length);
            Show();
        }

        private static Stepper Open(string sceneName, string modelName, Guard guard)
        {
            using (var opened = new Scene(sceneName))
            {
                if (string.IsNullOrEmpty(modelName)) return Stepper.OfPhysics(opened);
                using (var network = new Model(modelName))
                    return Stepper.OfModel(opened, network, guard);
            }
        }

        private bool BeReady()
        {
            if (opening == null || !opening.IsCompleted) return false;
            var opened = opening;
            opening = null;
            if (opened.Exception != null)
            {
                Fail(opened.Exception.InnerException);
                return false;
            }
            var made = opened.Result;
            if (made.Counts.Handles != (ulong)handles.Length)
            {
                Debug.LogError("handles: the scene has " + made.Counts.Handles + ", found "
                    + handles.Length, this);
                made.Dispose();
                enabled = false;
                return false;
            }
            foreach (string warning in made.Warnings) Debug.LogWarning(warning, this);
            stepper = made;
            MakeMesh();
            PlaceHandles();
            return true;
        }

        private void Fail(Exception error)
        {
            Debug.LogError(error.Message, this);
            enabled = false;
        }

        private void MakeMesh()
        {
            int count = (int)stepper.Counts.Vertices;
            positions = new float[3 * count];
            vertices = new Vector3[count];
            mesh = new Mesh { name = "Selvedge" };
            if (count > 65535) mesh.indexFormat = UnityEngine.Rendering.IndexFormat.UInt32;
            mesh.MarkDynamic();
            ReadPositions();
            mesh.vertices = vertices;
            uint[] faces = stepper.Faces();
            var triangles = new int[faces.Length];
            for (int k = 0; k < faces.Length; k += 3)
            {
                triangles[k] = (int)faces[k];
                triangles[k + 1] = (int)faces[k + 2];
                triangles[k + 2] = (int)faces[k + 1];
            }
            mesh.triangles = triangles;
            GetComponent<MeshFilter>().sharedMesh = mesh;
            Show();
        }

        private void PlaceHandles()
        {
            uint[] held = stepper.Handles();
            for (int k = 0; k < held.Length; k++)
                if (handles[k] != null)
                    handles[k].position = transform.TransformPoint(vertices[held[k]]);
            before = new double[3 * held.Length];
            now = new double[3 * held.Length];
            targets = new double[3 * held.Length];
            for (int k = 0; k < held.Length; k++) Put(vertices[held[k]], before, k);
            Array.Copy(before, now, before.Length);
        }

        // A handle without a transform stays where it is.
        private void ReadHandles(double[] into)
        {
            for (int k = 0; k < handles.Length; k++)
                if (handles[k] != null)
                    Put(transform.InverseTransformPoint(handles[k].position), into, k);
        }

        private static void Put(Vector3 point, double[] into, int k)
        {
            into[3 * k] = point.x;
            into[3 * k + 1] = point.y;
            into[3 * k + 2] = -point.z;
        }

        private void ReadPositions()
        {
            stepper.CopyPositions(positions);
            for (int k = 0; k < vertices.Length; k++)
                vertices[k] = new Vector3(
                    positions[3 * k], positions[3 * k + 1], -positions[3 * k + 2]);
        }

        private void Show()
        {
            ReadPositions();
            mesh.vertices = vertices;
            mesh.RecalculateNormals();
            mesh.RecalculateBounds();
        }
    }
}
