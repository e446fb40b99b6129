// A cloth that moves one frame at a time.
using System;
using System.Runtime.InteropServices;

namespace Selvedge
{
    /// <summary>Listener of a long call: the task, the units done, and those there are (0 where
    /// unknown). Returns false to stop. It may be called from other threads.</summary>
    public delegate bool Progress(string task, ulong done, ulong goal);

    /// <summary>A state of a stepper in memory.</summary>
    public sealed class Snapshot : IDisposable
    {
        internal readonly ulong Handle;

        internal Snapshot(ulong handle)
        {
            Handle = handle;
        }

        /// <summary>Frees a snapshot that nobody disposed of.</summary>
        ~Snapshot()
        {
            Native.selvedge_snapshot_free(Handle);
        }

        /// <summary>Frees the snapshot.</summary>
        public void Dispose()
        {
            Native.selvedge_snapshot_free(Handle);
            GC.SuppressFinalize(this);
        }
    }

    /// <summary>A cloth that moves one frame at a time. Calls from several threads wait for one
    /// another.</summary>
    public sealed class Stepper : IDisposable
    {
        private readonly ulong handle;
        private static readonly Native.Hear OnHear = Hear;

        private Stepper(ulong handle)
        {
            this.handle = handle;
            Counts = ReadCounts();
        }

        /// <summary>Frees a stepper that nobody disposed of.</summary>
        ~Stepper()
        {
            Native.selvedge_stepper_free(handle);
        }

        /// <summary>Counts when the stepper was made; <see cref="Frame"/> is that of
        /// now.</summary>
        public Counts Counts { get; }

        /// <summary>Frames since the start.</summary>
        public ulong Frame
        {
            get { return ReadCounts().Frame; }
        }

        /// <summary>Word of the guard on the newest frame of a model.</summary>
        public Trust Trust
        {
            get
            {
                Trust trust;
                Check(Native.selvedge_trust(handle, out trust));
                return trust;
            }
        }

        /// <summary>What is to be known of scene and model together.</summary>
        public string[] Warnings
        {
            get
            {
                var lines = Native.Lines((byte[] text, UIntPtr room, out UIntPtr needed) =>
                    Native.selvedge_stepper_warnings(handle, text, room, out needed));
                GC.KeepAlive(this);
                return lines;
            }
        }

        /// <summary>Makes the physics of a scene, where the scene starts.</summary>
        public static Stepper OfPhysics(Scene scene, Progress progress = null)
        {
            var stepper = Listening(progress, (ref Native.Listener listener, out ulong made) =>
                Native.selvedge_stepper_physics(scene.Handle, ref listener, out made));
            GC.KeepAlive(scene);
            return stepper;
        }

        /// <summary>Makes a model at work on a scene, from the scene's rest pose on.</summary>
        public static Stepper OfModel(
            Scene scene, Model model, Guard guard = Guard.Limit, Progress progress = null)
        {
            var stepper = Listening(progress, (ref Native.Listener listener, out ulong made) =>
                Native.selvedge_stepper_model(
                    scene.Handle, model.Handle, (int)guard, ref listener, out made));
            GC.KeepAlive(scene);
            GC.KeepAlive(model);
            return stepper;
        }

        /// <summary>Moves the cloth by one frame, its handles to <paramref name="targets"/> [m],
        /// [samples, handles, 3], the last sample at the end of the frame.</summary>
        /// <param name="released">Not 0 for handles that are let go, or null.</param>
        public void Step(double[] targets, int samples = 1, byte[] released = null)
        {
            int handles = (int)Counts.Handles;
            // The library cannot know the lengths of these arrays.
            if (targets == null || samples < 1 || targets.Length != 3L * samples * handles)
                throw new SelvedgeException(
                    Status.Count,
                    "targets: expected samples * " + handles + " handles * 3 numbers, found "
                        + (targets == null ? 0 : targets.Length));
            if (released != null && released.Length != handles)
                throw new SelvedgeException(
                    Status.Count,
                    "released: expected " + handles + " bytes, found " + released.Length);
            var (count, times) = ((UIntPtr)Counts.Handles, (UIntPtr)(uint)samples);
            Check(Native.selvedge_step(handle, targets, times, count, released));
        }

        /// <summary>Moves the cloth by one frame along the motion of its scene.</summary>
        public void StepAlong()
        {
            Check(Native.selvedge_step_along(handle));
        }

        /// <summary>Leads the body of this number in the scene in the next frame away from its own
        /// path, by the rigid motion of a 4×4 matrix, by columns.</summary>
        public void LeadBody(int body, double[] matrix)
        {
            Check(Native.selvedge_stepper_lead_body(handle, (UIntPtr)(uint)body, Sixteen(matrix)));
        }

        /// <summary>Sets the cloth elsewhere, by the rigid motion of a 4×4 matrix, by columns, and
        /// the bodies of these numbers along with it.</summary>
        public void Teleport(double[] matrix, params int[] bodies)
        {
            var along = Array.ConvertAll(bodies, body => (UIntPtr)(uint)body);
            var count = (UIntPtr)(uint)along.Length;
            Check(Native.selvedge_stepper_teleport(handle, Sixteen(matrix), along, count));
        }

        private static double[] Sixteen(double[] matrix)
        {
            // The library cannot know the length of this array.
            if (matrix != null && matrix.Length == 16) return matrix;
            throw new SelvedgeException(Status.Count, "matrix: expected 16 numbers, by columns");
        }

        /// <summary>Takes a snapshot, to which <see cref="Restore"/> goes back.</summary>
        public Snapshot TakeSnapshot()
        {
            ulong snapshot;
            Check(Native.selvedge_stepper_snapshot(handle, out snapshot));
            return new Snapshot(snapshot);
        }

        /// <summary>Goes back to a snapshot of this stepper, or of another one of its scene by the
        /// same mover.</summary>
        public void Restore(Snapshot snapshot)
        {
            Check(Native.selvedge_stepper_restore(handle, snapshot.Handle));
            GC.KeepAlive(snapshot);
        }

        /// <summary>Goes back to the start.</summary>
        public void Reset()
        {
            Check(Native.selvedge_stepper_reset(handle));
        }

        /// <summary>Lets steps end with Status.Stopped, the one under way in another thread too;
        /// false lets them go on again.</summary>
        public void Stop(bool wanted)
        {
            Check(Native.selvedge_stepper_stop(handle, wanted ? 1 : 0));
        }

        /// <summary>Targets of the next step as the motion of the scene has them.</summary>
        public double[] MotionTargets(int samples)
        {
            var targets = new double[checked(3 * Math.Max(samples, 0) * (int)Counts.Handles)];
            Check(Native.selvedge_motion_targets(
                handle, targets, (UIntPtr)(uint)Math.Max(samples, 0), (UIntPtr)Counts.Handles, null));
            return targets;
        }

        /// <summary>Copies the positions [m], [vertices, 3].</summary>
        public void CopyPositions(float[] positions)
        {
            Check(Native.selvedge_copy_positions(
                handle, positions, Room(positions.Length, "positions")));
        }

        /// <summary>Copies the positions with the digits that the physics has [m],
        /// [vertices, 3].</summary>
        public void CopyPositions(double[] positions)
        {
            Check(Native.selvedge_copy_positions_f64(
                handle, positions, Room(positions.Length, "positions")));
        }

        /// <summary>Copies what each body received from the cloth in the last frame, [bodies, 6]:
        /// momentum [N s], and angular momentum about the origin [N m s].</summary>
        public void CopyImpulses(double[] impulses)
        {
            Check(Native.selvedge_copy_impulses(
                handle, impulses, (UIntPtr)(uint)(impulses.Length / 6)));
        }

        /// <summary>Vertices of the faces, [faces, 3], counterclockwise from the front in
        /// right-handed axes.</summary>
        public uint[] Faces()
        {
            var faces = new uint[3 * Counts.Faces];
            Check(Native.selvedge_copy_faces(handle, faces, (UIntPtr)Counts.Faces));
            return faces;
        }

        /// <summary>Vertices of the handles, in the order of their targets.</summary>
        public uint[] Handles()
        {
            var handles = new uint[Counts.Handles];
            Check(Native.selvedge_copy_handles(handle, handles, (UIntPtr)Counts.Handles));
            return handles;
        }

        /// <summary>Frees the stepper.</summary>
        public void Dispose()
        {
            Native.selvedge_stepper_free(handle);
            GC.SuppressFinalize(this);
        }

        // The stepper is in use until its call has come back, also where that is its last.
        private void Check(Status status)
        {
            Native.Check(status);
            GC.KeepAlive(this);
        }

        private Counts ReadCounts()
        {
            Counts counts;
            Check(Native.selvedge_stepper_counts(handle, out counts));
            return counts;
        }

        // Vertices in an array of so many numbers; one that is no multiple of 3 fits no cloth.
        private static UIntPtr Room(int numbers, string name)
        {
            if (numbers % 3 != 0)
                throw new SelvedgeException(
                    Status.Count, name + ": expected 3 numbers per vertex, found " + numbers);
            return (UIntPtr)(uint)(numbers / 3);
        }

        private delegate Status Make(ref Native.Listener listener, out ulong made);

        private static Stepper Listening(Progress progress, Make make)
        {
            var listener = new Native.Listener();
            var kept = default(GCHandle);
            if (progress != null)
            {
                kept = GCHandle.Alloc(progress);
                listener.Hear = Marshal.GetFunctionPointerForDelegate(OnHear);
                listener.Context = GCHandle.ToIntPtr(kept);
            }
            try
            {
                ulong made;
                Native.Check(make(ref listener, out made));
                return new Stepper(made);
            }
            finally
            {
                if (kept.IsAllocated) kept.Free();
            }
        }

        // An exception must not cross the border: it stops the call.
        [MonoPInvokeCallback(typeof(Native.Hear))]
        private static int Hear(IntPtr context, IntPtr task, ulong done, ulong goal)
        {
            try
            {
                var progress = (Progress)GCHandle.FromIntPtr(context).Target;
                return progress(Native.Text(task), done, goal) ? 0 : 1;
            }
            catch (Exception)
            {
                return 1;
            }
        }
    }
}
