// As much of UnityEngine as the component needs, so that it is compiled and run without Unity. What
// Unity calls is called here by Game.
using System;
using System.Collections.Generic;
using System.Reflection;

namespace UnityEngine.Rendering
{
    public enum IndexFormat { UInt16, UInt32 }
}

namespace UnityEngine
{
    public struct Vector3
    {
        public float x, y, z;

        public Vector3(float x, float y, float z)
        {
            this.x = x;
            this.y = y;
            this.z = z;
        }

        public static Vector3 operator +(Vector3 a, Vector3 b)
        {
            return new Vector3(a.x + b.x, a.y + b.y, a.z + b.z);
        }

        public static Vector3 operator -(Vector3 a, Vector3 b)
        {
            return new Vector3(a.x - b.x, a.y - b.y, a.z - b.z);
        }

        public float magnitude
        {
            get { return (float)Math.Sqrt(x * x + y * y + z * z); }
        }
    }

    public class Object
    {
        public string name;

        public static void Destroy(Object thing)
        {
            Mesh.Alive.Remove((Mesh)thing);
        }
    }

    public class Component : Object
    {
        private readonly Dictionary<Type, object> others = new Dictionary<Type, object>();

        public Transform transform = null;

        public T GetComponent<T>() where T : new()
        {
            object found;
            if (!others.TryGetValue(typeof(T), out found)) others[typeof(T)] = found = new T();
            return (T)found;
        }
    }

    public class MonoBehaviour : Component
    {
        public bool enabled = true;
    }

    // A transform that is moved, and not turned.
    public class Transform : Component
    {
        public Vector3 position;

        public Vector3 TransformPoint(Vector3 point)
        {
            return point + position;
        }

        public Vector3 InverseTransformPoint(Vector3 point)
        {
            return point - position;
        }
    }

    public class MeshFilter : Component
    {
        public Mesh sharedMesh;
    }

    public class MeshRenderer : Component { }

    public class Mesh : Object
    {
        public static readonly List<Mesh> Alive = new List<Mesh>();

        public Vector3[] vertices;
        public int[] triangles;
        public Rendering.IndexFormat indexFormat;
        public int shown;

        public Mesh()
        {
            Alive.Add(this);
        }

        public void MarkDynamic() { }

        public void RecalculateNormals()
        {
            shown++;
        }

        public void RecalculateBounds() { }
    }

    public static class Time
    {
        public static float deltaTime;
    }

    public static class Debug
    {
        public static readonly List<string> Errors = new List<string>();
        public static readonly List<string> Warnings = new List<string>();

        public static void LogError(object message, Object context)
        {
            Errors.Add(message.ToString());
        }

        public static void LogWarning(object message, Object context)
        {
            Warnings.Add(message.ToString());
        }
    }

    [AttributeUsage(AttributeTargets.Field)]
    public sealed class TooltipAttribute : Attribute
    {
        public TooltipAttribute(string tooltip) { }
    }

    [AttributeUsage(AttributeTargets.Class)]
    public sealed class RequireComponent : Attribute
    {
        public RequireComponent(Type one, Type other) { }
    }

    public static class Game
    {
        // Calls what Unity calls by its name.
        public static void Send(MonoBehaviour component, string name)
        {
            const BindingFlags Own = BindingFlags.Instance | BindingFlags.NonPublic;
            component.GetType().GetMethod(name, Own).Invoke(component, null);
        }
    }
}
